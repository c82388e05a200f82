//! What is known about profiles before their samples are evaluated.

use super::super::cost::TableCosts;
use super::super::feasibility::Limits;
use super::super::grid::SampleGrid;
use super::super::obstacles::Obstacles;
use super::super::targets::Targets;
use super::choice::random_drive;
use crate::geometry::shape::Lcg;
use crate::plan::frame::Start;
use crate::plan::frenet::{FrenetSettings, Rejection, n_points, prepare};

/// Rows of many situations, with their costs and limits.
fn for_random_plans(mut look: impl FnMut(&mut SampleGrid, &mut TableCosts, &Limits, &crate::plan::PlanRequest)) {
    let mut random = Lcg::new(17);
    let (mut samples, mut costs) = (SampleGrid::default(), TableCosts::default());
    for world in 0..120 {
        let mut drive = random_drive(&mut random);
        if world % 4 == 0 {
            drive.state.acceleration = random.within(-9.0, 6.0);
        }
        if world % 5 == 0 {
            drive.state.velocity = random.within(0.0, 2.5);
        }
        // Some plans have more than two thousand points.
        let (dt, horizon) = if world % 10 == 9 { (0.01, 24.0) } else { (drive.dt, 3.0) };
        drive.dt = dt;
        let settings = FrenetSettings { d_max: random.within(0.5, 8.0), horizon, ..FrenetSettings::default() };
        drive.with_request(|request| {
            let Ok(start) = Start::new(request, true) else { return };
            let limits = Limits::new(request, n_points(request, &settings), start.curvature);
            let mut targets = Targets::new(request, &start, &settings);
            if world % 3 == 0 {
                targets.velocity = random.within(0.0, 30.0);
            }
            let tables = (&mut samples, &mut costs, &mut Obstacles::default());
            prepare(request, &settings, (&start, &targets, &limits), tables);
            look(&mut samples, &mut costs, &limits, request);
        });
    }
}

#[test]
fn bounds_of_rows_are_never_above_the_costs_of_their_samples_and_mostly_close() {
    let weights = FrenetSettings::default().weights;
    let (mut n_rows, mut n_close) = (0, 0);
    for_random_plans(|samples, costs, _, request| {
        let path = &request.route.path;
        for profile in 0..samples.profiles.len() {
            let bound = costs.bounds[profile];
            if samples.profiles[profile].rejection != Rejection::Admissible {
                assert_eq!(bound, f64::INFINITY);
                continue;
            }
            costs.compute_profile(samples, profile, &weights, path);
            let n_offsets = samples.end_offsets.len();
            let totals = &costs.total[profile * n_offsets..(profile + 1) * n_offsets];
            let least = totals.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(bound > 0.0 && bound <= least, "{bound} {least}");
            n_rows += 1;
            n_close += usize::from(bound > 0.8 * least);
        }
    });
    assert!(n_rows > 4000 && 2 * n_close > n_rows, "{n_close} of {n_rows}");
}

#[test]
fn rows_that_are_not_rejected_keep_the_limits_along_the_path_and_no_arc_length_is_beyond_the_furthest() {
    let mut n_rejected = 0;
    for_random_plans(|samples, _, limits, request| {
        for profile in 0..samples.profiles.len() {
            samples.load_motion(profile);
            let is_admissible = samples.profiles[profile].rejection == Rejection::Admissible;
            n_rejected += usize::from(!is_admissible);
            let motion = samples.motions(profile);
            let slowest = motion.s_dot.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(slowest >= 0.0);
            assert!(samples.profiles[profile].is_over_arc || slowest > 2.0 - 1e-4, "{slowest}");
            for i in (0..limits.n_points).filter(|_| is_admissible) {
                let found = limits.check_along_path(motion.s_dot[i], motion.s_ddot[i], i);
                assert_eq!(found, Rejection::Admissible);
                assert!((0.0..=request.route.path.length()).contains(&motion.s[i]));
                assert!(motion.s[i] <= samples.furthest[i]);
            }
            assert_eq!(motion.s[limits.n_points - 1], samples.last_place(profile));
        }
    });
    assert!(n_rejected > 500, "{n_rejected}");
}
