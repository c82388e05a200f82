//! Predictions where ways lie one above the other: what drives onto another storey does not meet the agent there.

use super::{Drive, World};
use crate::geometry::Pose;
use crate::plan::Other;
use crate::road::{RoadNetwork, heights_are_apart};
use crate::route::Route;
use crate::trajectory::Predictions;

impl World {
    /// Predictions as one agent needs them: the expectations of others end where they are above or below its way.
    /// `None` if none has to end.
    pub(super) fn on_its_storey(
        &self,
        drive: &Drive,
        others: &[Other<'_>],
        predictions: &Predictions,
    ) -> Option<Predictions> {
        let (road, route) = (&self.scenario.road, &drive.agent.route);
        if !road.has_heights() {
            return None;
        }
        let mut found: Option<Predictions> = None;
        for other in others.iter().filter(|other| !other.is_static) {
            let now = road.height_at(other.pose);
            for mode in 0..predictions.n_modes {
                let first = predictions.offset(other.row, mode);
                let steps = first..first + predictions.n_steps;
                let mut height = now;
                let leaves = steps.clone().take_while(|k| predictions.valid[*k]).find(|k| {
                    let pose = Pose::new(predictions.x[*k], predictions.y[*k], predictions.orientation[*k]);
                    height = road.height_from(height, pose);
                    heights_are_apart(height, height_of_way(road, route, pose))
                });
                if let Some(leaves) = leaves {
                    let table = found.get_or_insert_with(|| predictions.clone());
                    table.valid[leaves..steps.end].fill(false);
                }
            }
        }
        found
    }
}

/// Height of a route where it is nearest to a pose [m].
fn height_of_way(road: &RoadNetwork, route: &Route, pose: Pose) -> Option<f64> {
    let (s, _) = route.path.project(pose.position)?;
    let place = route.path.at(s).position;
    let lanelet = road
        .lanelets_at(place)
        .into_iter()
        .find(|lanelet| route.pieces.iter().any(|piece| piece.lanelet == *lanelet))?;
    road.height_of(lanelet, place)
}
