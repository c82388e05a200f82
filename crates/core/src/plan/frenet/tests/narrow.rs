//! Where the road is narrow: the search for something faster than crawling.

use std::f64::consts::FRAC_PI_2;

use super::Drive;
use crate::geometry::shape::Lcg;
use crate::plan::frenet::{
    Assumptions, FrenetMemory, FrenetSettings, Incumbent, attempt, end_velocity, faster, is_held_by_road,
};
use crate::road::testing::{arc, open, straight, tapered_lane};

/// A slow agent before or in a bend of 5 to 8 m radius on a lane that is 0.1 to 0.6 m wider than the vehicle.
fn in_a_narrow_bend(random: &mut Lcg) -> Drive {
    let radius = random.within(5.0, 8.0);
    let mut center = straight((0.0, 0.0), (30.0, 0.0));
    center.extend(arc((30.0, radius), radius, -FRAC_PI_2, 0.0).into_iter().skip(1));
    center.extend(straight((30.0 + radius, radius), (30.0 + radius, radius + 40.0)).into_iter().skip(1));
    let width = random.within(1.7, 2.2);
    let road = open(vec![tapered_lane(1, &center, width, width)]);
    let mut drive = Drive::on(road, &center, random.within(22.0, 38.0), random.within(0.0, 2.0));
    drive.entry_velocity = 6.0;
    drive
}

#[test]
fn a_plan_that_crawls_for_the_road_is_replaced_by_the_one_that_a_search_from_nothing_finds() {
    let mut random = Lcg::new(3);
    let (lazy, full) = (FrenetSettings::default(), FrenetSettings { lazy: false, ..FrenetSettings::default() });
    let (mut memory, mut anew) = (FrenetMemory::default(), FrenetMemory::default());
    let (mut n_held, mut n_faster, mut effort, mut effort_anew) = (0, 0, 0, 0);
    for world in 0..300 {
        let drive = in_a_narrow_bend(&mut random);
        drive.with_request(|request| {
            memory.effort = 0;
            let crawling = attempt(request, &lazy, &mut memory, Assumptions::NOMINAL);
            if !is_held_by_road(&crawling, &memory) {
                return;
            }
            n_held += 1;
            memory.effort = 0;
            let undrivable = memory.evaluation.undrivable.clone();
            let found = faster(request, &lazy, &mut memory, &crawling);
            effort += memory.effort;
            anew.effort = 0;
            attempt(request, &lazy, &mut anew, Assumptions::NARROW);
            effort_anew += anew.effort;
            // The motions of the first search give what a search from nothing finds, sample by sample.
            let (eager, all) = (drive.plan(&full), drive.candidates(&lazy));
            let chosen = all.chosen.expect("at least the plan that crawls");
            let result = found.as_ref().unwrap_or(&crawling);
            if Incumbent::of(result).is_held_by_limits(&undrivable) {
                return; // Then samples are steered.
            }
            assert_eq!(eager.trajectory, result.trajectory, "world {world}");
            assert!((all.cost[chosen] - result.cost).abs() < 1e-9 * result.cost, "world {world}");
            if found.is_some() {
                n_faster += 1;
                assert!(end_velocity(result) > end_velocity(&crawling) && result.cost < crawling.cost, "{world}");
            }
        });
    }
    assert!(n_held > 20 && n_faster > 5, "{n_held} {n_faster}");
    assert!(effort <= effort_anew, "{effort} {effort_anew}");
}
