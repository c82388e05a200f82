//! A road of 200 m along x with a stop line at x = 100; the path is the x axis, so arc lengths differ from x by a constant.

use std::sync::Arc;

use super::*;
use crate::barrier::BarrierReason;
use crate::control::{StopLineInput, TrafficLight};
use crate::road::testing::{lane, open, straight, with_successors};
use crate::route::PathPiece;
use crate::scenario::Obstacles;

/// Lanelets 1, from 0 to 100 m, and 2, from there to 200 m with a limit of 8 m/s; the light counts on the way to 2.
fn scenario(phases: &[(i64, Signal)], has_stop_sign: bool) -> Scenario {
    let mut second = lane(2, &straight((100.0, 0.0), (200.0, 0.0)));
    second.speed_limit = 8.0;
    let road = Arc::new(open(vec![with_successors(lane(1, &straight((0.0, 0.0), (100.0, 0.0))), &[2]), second]));
    let light = TrafficLight { id: 7, offset: 0, phases: phases.to_vec() };
    let ends = [Point::new(100.0, 1.75), Point::new(100.0, -1.75)];
    let line = StopLineInput { lanelet: 1, ends, has_stop_sign, lights: vec![(2, vec![0])], turns_on_red: vec![] };
    let control = Control::new(vec![light], vec![line], &road);
    let mut scenario = Scenario::new(0.1, road, Obstacles::default()).expect("a scenario");
    scenario.control = control.expect("lights and lines");
    scenario
}

fn path() -> ReferencePath {
    ReferencePath::through(&[Point::new(0.0, 0.0), Point::new(200.0, 0.0)]).expect("a path")
}

/// The arc length that an agent must not pass, `entered` steps after the start of the light's cycle.
fn stop(scenario: &Scenario, (time_step, entered): (i64, i64), front: f64, velocity: f64) -> f64 {
    let settings = RulesSettings::default();
    let way = Way::along(&path(), &PathPiece::chain(&path(), &[0, 1], &scenario.road), scenario, &settings);
    let control = &scenario.control;
    let rules = Rules { control, settings: &settings, way: &way, time_step, entered, ..Rules::default() };
    rules.barriers(&way, front, velocity).nearest()
}

#[test]
fn a_red_light_holds_at_its_line_and_a_green_or_dark_one_does_not() {
    for (signal, expected) in
        [(Signal::Red, 100.0), (Signal::Yellow, 100.0), (Signal::Green, f64::INFINITY), (Signal::Dark, f64::INFINITY)]
    {
        let found = stop(&scenario(&[(1000, signal)], false), (500, 0), 60.0, 10.0);
        assert!(found == expected || (found - expected).abs() < 1e-6, "{signal:?}: {found}");
    }
}

#[test]
fn a_light_behind_the_front_does_not_hold() {
    assert_eq!(stop(&scenario(&[(1000, Signal::Red)], false), (500, 0), 100.5, 10.0), f64::INFINITY);
}

#[test]
fn on_yellow_an_agent_stops_if_three_metres_per_second_squared_suffice_when_it_begins() {
    let light = scenario(&[(100, Signal::Green), (30, Signal::Yellow), (500, Signal::Red)], false);
    let velocity = 13.41;
    // 13.41² / (2 · 30 m) = 2.997 m/s², 13.41² / (2 · 29 m) = 3.10 m/s²
    assert!(stop(&light, (100, 0), 70.0, velocity).is_finite());
    assert!(stop(&light, (100, 0), 71.0, velocity).is_infinite());
    // One second later it is 13.41 m further, and the decision is the same ...
    assert!(stop(&light, (110, 0), 71.0 + 13.41, velocity).is_infinite());
    // ... and on red, too; a vehicle that was further away and did not brake has to.
    assert!(stop(&light, (131, 0), 71.0 + 28.9, 13.0).is_finite());
    assert!(stop(&light, (120, 0), 70.0 + 20.0, 7.0).is_finite());
}

#[test]
fn an_agent_that_enters_too_near_to_a_red_light_is_not_held() {
    let red = scenario(&[(1000, Signal::Red)], false);
    assert!(stop(&red, (500, 500), 95.0, 10.0).is_infinite(), "10 m/s² would be needed");
    assert!(stop(&red, (505, 500), 99.9, 10.0).is_infinite(), "it is the same vehicle half a second later");
    assert!(stop(&red, (500, 500), 80.0, 10.0).is_finite());
}

#[test]
fn an_agent_that_was_too_near_when_the_light_changed_remembers_it_as_long_as_it_cannot_stop() {
    let light = scenario(&[(100, Signal::Green), (30, Signal::Yellow), (500, Signal::Red)], false);
    let settings = RulesSettings::default();
    let way = Way::along(&path(), &PathPiece::chain(&path(), &[0, 1], &light.road), &light, &settings);
    let at = |time_step: i64, stop: LineMemory| {
        let passing = stop.passing();
        Rules { control: &light.control, settings: &settings, way: &way, time_step, passing, ..Rules::default() }
    };
    // 14² / (2 · 27 m) = 3.63 m/s²: it goes on, and slows down for something else.
    let near = LineMemory::default().looking(&at(100, LineMemory::default()), &way, 73.0, 14.0);
    assert!(near.passing().is_some_and(|distance| (distance - 27.0).abs() < 1e-6));
    // What it remembers comes nearer as it drives.
    let later = |way: f64| (0..10).fold(near, |memory, _| memory.after(way, 0.1));
    // One that could have stopped, and is faster a step later, does not become too near.
    assert_eq!(LineMemory::default().looking(&at(101, LineMemory::default()), &way, 73.0, 14.0).passing(), None);
    // 12 m/s, 12 m before the line, 1.2 s later: 6 m/s². At this speed it could have stopped when the light changed.
    assert!(
        at(112, LineMemory::default()).barriers(&way, 88.0, 12.0).nearest().is_finite(),
        "without memory it brakes hard"
    );
    assert!(at(112, later(15.0)).barriers(&way, 88.0, 12.0).nearest().is_infinite());
    // 5 m/s, 5 m before it: 2.5 m/s².
    assert!(at(118, later(22.0)).barriers(&way, 95.0, 5.0).nearest().is_finite(), "it can stop");
    assert_eq!(later(22.0).looking(&at(118, later(22.0)), &way, 95.0, 5.0).passing(), None, "and then it has to");
    assert_eq!(
        later(28.0).looking(&at(118, later(28.0)), &way, 101.0, 12.0).passing(),
        None,
        "behind the line it is forgotten"
    );
    assert_eq!(later(15.0).looking(&at(700, later(15.0)), &way, 88.0, 12.0).passing(), None, "on green, too");
}

#[test]
fn a_stop_sign_holds_until_the_agent_has_stood_before_its_line() {
    let scenario = scenario(&[], true);
    let settings = RulesSettings::default();
    let way = Way::along(&path(), &PathPiece::chain(&path(), &[0, 1], &scenario.road), &scenario, &settings);
    let control = &scenario.control;
    let is_held = |memory: LineMemory, front: f64| {
        let served = memory.served(&settings, 0.1);
        let rules = Rules { control, settings: &settings, way: &way, served, ..Rules::default() };
        rules.barriers(&way, front, 0.0).nearest().is_finite()
    };
    let stands = |memory: LineMemory, steps: usize| (0..steps).fold(memory, |memory, _| memory.after(0.0, 0.1));
    let drives = |memory: LineMemory, way: f64| (0..10).fold(memory, |memory, _| memory.after(way, 0.1));
    let new = LineMemory::default();
    assert!(is_held(stands(new, 9), 99.0) && !is_held(stands(new, 10), 99.0), "one second of standing");
    assert!(is_held(stands(new, 30), 97.5), "not before the line, but 2.5 m away");
    assert!(is_held(drives(stands(new, 30), 1.5), 99.0), "it stood 2.5 m away, and now nearer");
    assert!(is_held(stands(drives(stands(new, 30), 1.5), 5), 99.0), "and the second time not for long");
    assert!(!is_held(drives(stands(new, 30), 0.9), 99.9), "it stood 1 m away, and drives on");
    assert!(is_held(drives(new, 0.9), 99.9), "it never stood");
    let back = drives(drives(stands(new, 30), 1.5), -1.5);
    assert!(!is_held(back, 99.0), "it stood 1 m away, passed the line and has reversed to where it stood");
    assert!(is_held(drives(stands(new, 30), -3.0), 97.0), "it has reversed 3 m");
    assert!(is_held(drives(stands(new, 30), 3.0), 99.9), "behind a line the stop is forgotten");
}

#[test]
fn a_right_turn_on_red_waits_as_long_as_a_stop_sign_and_goes_last_until_it_is_behind_the_line() {
    let mut scenario = scenario(&[(100, Signal::Red), (20, Signal::Yellow), (10, Signal::Green)], false);
    scenario.control.lines[0].turns_on_red = vec![1];
    let after = |settings: &RulesSettings, time_step: i64, standing: usize, front: f64| {
        let way = Way::along(&path(), &PathPiece::chain(&path(), &[0, 1], &scenario.road), &scenario, settings);
        let control = &scenario.control;
        let stood = (0..standing).fold(LineMemory::default(), |memory, _| memory.after(0.0, 0.1));
        let served = stood.served(settings, 0.1);
        let rules = Rules { control, settings, way: &way, time_step, served, ..Rules::default() };
        (rules.barriers(&way, front, 0.0).nearest().is_finite(), rules.turns_on_red(&way, front))
    };
    let on = RulesSettings::default();
    assert_eq!(after(&on, 50, 9, 99.0), (true, false), "it has not stood for a second");
    assert_eq!(after(&on, 50, 10, 99.0), (false, true));
    assert_eq!(after(&on, 50, 0, 110.0), (false, true), "10 m behind the line");
    assert_eq!(after(&on, 50, 0, 116.0), (false, false), "16 m behind the line");
    assert_eq!(after(&on, 105, 10, 99.0), (true, false), "yellow holds it");
    assert_eq!(after(&on, 125, 10, 99.0), (false, false), "on green it is like others");
    let off = RulesSettings { right_on_red: false, ..on };
    assert_eq!(after(&off, 50, 10, 99.0), (true, false));
}

#[test]
fn switched_off_rules_hold_no_agent() {
    let scenario = scenario(&[(1000, Signal::Red)], true);
    for settings in [
        RulesSettings { enabled: false, ..RulesSettings::default() },
        RulesSettings { lights: false, stop_signs: false, ..RulesSettings::default() },
    ] {
        let way = Way::along(&path(), &PathPiece::chain(&path(), &[0, 1], &scenario.road), &scenario, &settings);
        let rules = Rules { control: &scenario.control, settings: &settings, way: &way, ..Rules::default() };
        assert_eq!(rules.barriers(&way, 50.0, 5.0).nearest(), f64::INFINITY);
    }
}

#[test]
fn a_speed_limit_holds_on_its_lanelet_times_the_factor() {
    let scenario = scenario(&[], false);
    for (speed, factor, expected) in [(true, 1.0, 8.0), (true, 1.25, 10.0), (false, 1.0, f64::INFINITY)] {
        let settings = RulesSettings { speed, speed_factor: factor, ..RulesSettings::default() };
        let limits =
            Way::along(&path(), &PathPiece::chain(&path(), &[0, 1], &scenario.road), &scenario, &settings).limits;
        assert_eq!((limits.at(50.0), limits.at(150.0)), (f64::INFINITY, expected));
    }
}

#[test]
fn a_crosswalk_holds_like_a_line_whatever_is_before_it() {
    let light = scenario(&[(1000, Signal::Red)], false);
    let settings = RulesSettings::default();
    let way = Way::along(&path(), &PathPiece::chain(&path(), &[0, 1], &light.road), &light, &settings);
    for (crosswalk, expected) in [(20.0, 80.0), (60.0, 100.0)] {
        let mut told = Barriers::NONE;
        told.push(Barrier::lasting(7.0 + crosswalk, BarrierReason::Crosswalk));
        let rules =
            Rules { control: &light.control, settings: &settings, way: &way, front: 7.0, told, ..Rules::default() };
        let found = rules.barriers(&way, 60.0, 10.0);
        assert!((found.nearest() - expected).abs() < 1e-6, "{crosswalk} m before the front");
        assert_eq!(
            found.iter().map(|one| one.reason).collect::<Vec<_>>(),
            [BarrierReason::Light, BarrierReason::Crosswalk]
        );
    }
}
