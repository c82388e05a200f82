//! Specifications of the whole planner, on small invented roads.

mod emergency;
mod choice;
mod closed_loop;
mod golden;
mod kinematics;
mod single;
mod starts;

pub(super) use choice::random_drive;

use super::{Candidates, FrenetMemory, FrenetSettings, candidates, plan};
use crate::plan::PlanResult;
use crate::plan::testing::{Car, Drive};

impl Drive {
    fn plan(&self, settings: &FrenetSettings) -> PlanResult {
        self.with_request(|request| plan(request, settings, &mut FrenetMemory::default()))
    }

    fn candidates(&self, settings: &FrenetSettings) -> Candidates {
        self.with_request(|request| candidates(request, settings))
    }
}
