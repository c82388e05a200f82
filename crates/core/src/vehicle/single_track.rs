//! Single-track model driven by two inputs, within the limits of the vehicle. Nothing is hidden in it: the steering angle
//! follows from speed and yaw rate, so planners and learners can take over from each other at any step.

use super::Vehicle;
use crate::geometry::{Point, wrap_angle};
use crate::settings::{choice, positive, settings};
use crate::trajectory::State;

/// Longest substep [s].
const SUBSTEP: f64 = 0.1;
/// Up to this speed [m/s] the yaw rate says nothing about the steering angle.
pub const CREEPING_SPEED: f64 = 0.1;
/// Over shorter ways [m] the change of heading says nothing about the steering angle.
const NO_TRAVEL: f64 = 1e-6;
/// Speeds below this [m/s] count as it in the bounds of curvature.
const SPEED_MIN: f64 = 1.0;

choice! {
    /// What the second input is.
    pub enum Steering {
        /// The curvature of the rear axle's path.
        Curvature = "curvature",
        /// The rate of the steering angle.
        Rate = "rate",
    }
}

settings! {
    /// Pedals and steering wheel of a single-track model: two numbers from -1 to 1.
    pub struct Kinematic as Kinematic {
        /// Acceleration for a first number of 1, limited by the engine.
        accelerate: f64 ["m/s²"] = 4.0, positive(100.0);
        /// Deceleration for a first number of -1.
        brake: f64 ["m/s²"] = 8.0, positive(100.0);
        /// Meaning of the second number. "curvature": curvature of the path, relative to `curvature`. "rate": rate of
        /// the steering angle, relative to the vehicle's limit.
        steering: Steering = Steering::Curvature;
        /// Largest curvature with steering "curvature".
        curvature: f64 ["1/m"] = 0.2, positive(10.0);
        /// Largest lateral acceleration with steering "curvature".
        lateral: f64 ["m/s²"] = 4.0, positive(100.0);
    }
}

/// A state after a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moved {
    /// The state.
    pub state: State,
    /// The vehicle could not execute the action.
    pub limited: bool,
}

impl Kinematic {
    /// The state `dt` [s] later, by one or more substeps of at most 0.1 s. The numbers are clipped to -1 to 1;
    /// `path_curvature` [1/m] tells the steering angle of a vehicle that stands. It never starts to reverse; a vehicle that
    /// rolls backwards brakes to a stop, whatever the pedal asks for.
    pub fn step(
        &self,
        vehicle: &Vehicle,
        state: &State,
        [pedal, wheel]: [f64; 2],
        path_curvature: f64,
        dt: f64,
    ) -> Moved {
        let (pedal, wheel) = (pedal.clamp(-1.0, 1.0), wheel.clamp(-1.0, 1.0));
        let n = substeps(dt);
        let h = dt / n;
        let axle = vehicle.rear_axle_from_center(state.pose());
        let mut now = Substate {
            axle,
            heading: state.orientation,
            velocity: state.velocity,
            steering: steering_angle(vehicle, state, path_curvature),
            acceleration: 0.0,
            limited: false,
        };
        for _ in 0..n as usize {
            now = self.substep(vehicle, &now, (pedal, wheel), h);
        }
        let Point { x, y } = now.axle + Point::from_angle(now.heading) * vehicle.rear_axle_to_center;
        let yaw_rate = now.velocity * now.steering.tan() / vehicle.wheelbase;
        let (orientation, velocity, acceleration) = (now.heading, now.velocity, now.acceleration);
        Moved { state: State { x, y, orientation, velocity, acceleration, yaw_rate }, limited: now.limited }
    }

    fn substep(&self, vehicle: &Vehicle, now: &Substate, (pedal, wheel): (f64, f64), h: f64) -> Substate {
        let (velocity, wheelbase) = (now.velocity, vehicle.wheelbase);
        let rolls_back = velocity < 0.0;
        let asked = pedal * if pedal >= 0.0 { self.accelerate } else { self.brake };
        let a = if rolls_back {
            self.brake.min(vehicle.acceleration_max)
        } else {
            asked.clamp(-vehicle.acceleration_max, vehicle.forward_acceleration_max(velocity))
        };
        let (mut next_velocity, mut travel) = (velocity + a * h, (velocity + velocity + a * h) * 0.5 * h);
        if (next_velocity < 0.0) != rolls_back {
            (next_velocity, travel) = (0.0, velocity * velocity / (-2.0 * a));
        } else if next_velocity > vehicle.velocity_max {
            let top = vehicle.velocity_max;
            let time = ((top - velocity) / a).clamp(0.0, h);
            (next_velocity, travel) = (top, (velocity + top) * 0.5 * time + top * (h - time));
        }
        let wanted = match self.steering {
            Steering::Curvature => (wheelbase * wheel * self.curvature_at(vehicle, next_velocity)).atan(),
            Steering::Rate => now.steering + wheel * vehicle.steering_rate_max * h,
        };
        let reach = vehicle.steering_rate_max * h;
        let bound = steering_bound(vehicle, next_velocity);
        let steering = wanted.clamp(now.steering - reach, now.steering + reach).clamp(-bound, bound);
        let turn = (0.5 * (now.steering + steering)).tan() / wheelbase * travel;
        let half = 0.5 * turn;
        let sinc = if turn.abs() < 1e-3 { 1.0 - half * half / 6.0 } else { half.sin() / half };
        Substate {
            axle: now.axle + Point::from_angle(now.heading + half) * (travel * sinc),
            heading: now.heading + turn,
            velocity: next_velocity,
            steering,
            acceleration: (next_velocity - velocity) / h,
            limited: now.limited || a != asked || steering != wanted,
        }
    }

    /// Curvature for a second number of 1 [1/m].
    fn curvature_at(&self, vehicle: &Vehicle, velocity: f64) -> f64 {
        let by_tyres = self.lateral / velocity.abs().max(SPEED_MIN).powi(2);
        vehicle.curvature_max().min(self.curvature).min(by_tyres)
    }

    /// The numbers that lead from one state to the next in one substep; not clipped, so that numbers beyond -1 to 1 say
    /// that the model cannot do it.
    pub fn inverse(&self, vehicle: &Vehicle, from: &State, to: &State, path_curvature: f64, dt: f64) -> [f64; 2] {
        let (velocity, next) = (from.velocity.max(0.0), to.velocity.max(0.0));
        let acceleration = (next - velocity) / dt;
        let pedal = acceleration / if acceleration >= 0.0 { self.accelerate } else { self.brake };
        let travel = 0.5 * (velocity + next) * dt;
        if travel < NO_TRAVEL {
            return [pedal, 0.0];
        }
        let steering = steering_angle(vehicle, from, path_curvature);
        let turn = wrap_angle(to.orientation - from.orientation);
        let next_steering = 2.0 * (vehicle.wheelbase * turn / travel).atan() - steering;
        let wheel = match self.steering {
            Steering::Curvature => next_steering.tan() / (vehicle.wheelbase * self.curvature_at(vehicle, next)),
            Steering::Rate => (next_steering - steering) / (vehicle.steering_rate_max * dt),
        };
        [pedal, wheel]
    }
}

/// Between substeps.
struct Substate {
    axle: Point,
    heading: f64,
    velocity: f64,
    steering: f64,
    acceleration: f64,
    limited: bool,
}

/// Number of substeps.
fn substeps(dt: f64) -> f64 {
    (dt / SUBSTEP - 1e-9).ceil().max(1.0)
}

/// Steering angle of a state [rad], within the limits; `path_curvature` [1/m] is that of the path where it stands.
pub fn steering_angle(vehicle: &Vehicle, state: &State, path_curvature: f64) -> f64 {
    let curvature =
        if state.velocity.abs() > CREEPING_SPEED { state.yaw_rate / state.velocity } else { path_curvature };
    (vehicle.wheelbase * curvature).atan().clamp(-vehicle.steering_angle_max, vehicle.steering_angle_max)
}

/// Largest steering angle at a speed: that of the wheels and that of the tyres [rad].
fn steering_bound(vehicle: &Vehicle, velocity: f64) -> f64 {
    let by_tyres =
        (vehicle.wheelbase * vehicle.lateral_acceleration_max / velocity.abs().max(SPEED_MIN).powi(2)).atan();
    vehicle.steering_angle_max.min(by_tyres)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::shape::Lcg;

    const CAR: Vehicle = Vehicle::BMW_320I;

    fn state([x, y, orientation, velocity, yaw_rate]: [f64; 5]) -> State {
        State { x, y, orientation, velocity, acceleration: 0.0, yaw_rate }
    }

    fn rate() -> Kinematic {
        Kinematic { steering: Steering::Rate, ..Kinematic::default() }
    }

    fn close(found: State, expected: [f64; 6]) {
        let State { x, y, orientation, velocity, acceleration, yaw_rate } = found;
        for (value, expected) in [x, y, orientation, velocity, acceleration, yaw_rate].into_iter().zip(expected) {
            assert!((value - expected).abs() < 1e-9, "{found:?}, expected {expected}");
        }
    }

    #[test]
    fn steps_are_those_of_the_formulas_worked_out_elsewhere() {
        const A: [f64; 5] = [10.0, 5.0, 0.3, 12.0, 0.05];
        let stick = Kinematic::default();
        for (model, from, inputs, curvature, dt, expected) in [
            (stick, A, [0.5, 0.25], 0.0, 0.1, [11.151973092, 5.370324843, 0.306585530, 12.2, 2.0, 0.081967213]),
            (
                stick,
                [0.0, 0.0, -1.2, 0.5, 0.0],
                [-1.0, 1.0],
                0.0,
                0.1,
                [0.005823422, -0.014500280, -1.199878809, 0.0, -5.0, 0.0],
            ),
            (
                stick,
                [0.0, 0.0, 3.1, 0.0, 0.0],
                [1.0, -1.0],
                0.1,
                0.1,
                [-0.020089639, -0.001795830, 3.101835407, 0.4, 4.0, 0.033447309],
            ),
            (
                stick,
                [0.0, 0.0, 0.0, 40.0, 0.0],
                [1.0, 1.0],
                0.0,
                0.1,
                [4.010487107, 0.017005361, 0.004960770, 40.210421250, 2.104212500, 0.099476700],
            ),
            (stick, [0.0, 0.0, 0.0, 50.7, 0.0], [1.0, 0.0], 0.0, 0.1, [5.076988184, 0.0, 0.0, 50.8, 1.0, 0.0]),
            (rate(), A, [0.5, 0.25], 0.0, 0.1, [11.151482435, 5.371876356, 0.307388033, 12.2, 2.0, 0.098152214]),
            (stick, A, [0.5, 0.25], 0.0, 0.4, [14.702280791, 6.577946639, 0.330594238, 12.8, 2.0, 0.078125]),
        ] {
            close(model.step(&CAR, &state(from), inputs, curvature, dt).state, expected);
        }
    }

    #[test]
    fn thirty_steps_with_changing_inputs_end_where_the_formulas_say() {
        let mut now = state([10.0, 5.0, 0.3, 12.0, 0.05]);
        for i in 0..30 {
            let i = f64::from(i);
            now = Kinematic::default().step(&CAR, &now, [(0.3 * i).sin(), (0.2 * i).cos()], 0.0, 0.1).state;
        }
        close(now, [43.898547083, 16.189237630, 0.213684262, 11.781816752, 2.651876920, 0.300639379]);
    }

    #[test]
    fn what_moved_a_vehicle_can_be_told_from_its_states_and_limits_are_kept() {
        let mut random = Lcg::new(7);
        for model in [Kinematic::default(), rate()] {
            let mut told = 0;
            for _ in 0..10_000 {
                let velocity = random.within(1.0, 45.0);
                let yaw_rate = random.within(-1.0, 1.0) * (0.5 * CAR.lateral_acceleration_max / velocity).min(0.3);
                let from = state([
                    random.within(-1e3, 1e3),
                    random.within(-1e3, 1e3),
                    random.within(-3.0, 3.0),
                    velocity,
                    yaw_rate,
                ]);
                let inputs = [random.within(-1.0, 1.0), random.within(-1.0, 1.0)];
                let Moved { state: to, limited } = model.step(&CAR, &from, inputs, 0.0, 0.1);
                assert!(to.velocity >= 0.0 && to.velocity <= CAR.velocity_max);
                assert!((to.velocity * to.yaw_rate).abs() <= CAR.lateral_acceleration_max * 1.000_001);
                let (before, after) = (steering_angle(&CAR, &from, 0.0), steering_angle(&CAR, &to, 0.0));
                assert!((after - before).abs() <= 0.1 * CAR.steering_rate_max + 1e-9);
                // One that stops brakes for a part of the step only.
                if !limited && to.velocity > 0.0 {
                    let found = model.inverse(&CAR, &from, &to, 0.0, 0.1);
                    let again = model.step(&CAR, &from, found, 0.0, 0.1).state;
                    assert!(again.pose().position.distance(to.pose().position) < 1e-9);
                    assert!((again.orientation - to.orientation).abs() < 1e-9);
                    assert!((found[0] - inputs[0]).abs() < 1e-9, "{found:?} {inputs:?}");
                    told += 1;
                }
            }
            assert!(told > 2_000, "{told}");
        }
    }

    #[test]
    fn a_vehicle_that_rolls_backwards_brakes_to_a_stop_and_stays() {
        let (model, mut now) = (Kinematic::default(), state([0.0, 0.0, 0.0, -2.0, 0.1]));
        for speed in [-1.2, -0.4, 0.0] {
            let moved = model.step(&CAR, &now, [1.0, 0.0], 0.0, 0.1);
            assert!((moved.state.velocity - speed).abs() < 1e-9 && moved.limited, "{moved:?}");
            now = moved.state;
        }
        // 2² / (2 · 8) m, and a little to the side.
        assert!((now.x + 0.25).abs() < 1e-3 && now.y.abs() < 0.02, "{now:?}");
        assert_eq!(model.step(&CAR, &now, [-1.0, 0.0], 0.0, 0.1).state.velocity, 0.0);
    }

    #[test]
    fn a_vehicle_that_stands_stays_and_says_so() {
        let from = state([0.0, 0.0, 0.0, 0.0, 0.0]);
        let moved = Kinematic::default().step(&CAR, &from, [-1.0, 0.0], 0.0, 0.1);
        assert_eq!((moved.state, moved.limited), (from, false));
        assert!(Kinematic { brake: 20.0, ..Kinematic::default() }.step(&CAR, &from, [-1.0, 0.0], 0.0, 0.1).limited);
    }
}
