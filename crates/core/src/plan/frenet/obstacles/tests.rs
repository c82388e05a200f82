use super::*;
use crate::geometry::shape::Lcg;

/// Where maps in UTM coordinates are [m].
const FAR: Point = Point { x: 5e5, y: 5.3e6 };

/// A body or what one sweeps, from a pedestrian to a long trailer.
fn any_box(center: Point, random: &mut Lcg) -> OrientedBox {
    let (length, width) = [(0.5, 0.5), (4.5, 1.8), (18.0, 2.6), (60.0, 4.0)][random.within(0.0, 4.0) as usize];
    OrientedBox::new(Pose { position: center, orientation: random.within(-4.0, 4.0) }, length, width)
}

/// A box moved along a direction to where it just overlaps another one.
fn borderline(a: &OrientedBox, random: &mut Lcg) -> OrientedBox {
    let (way, b) = (Point::from_angle(random.within(-4.0, 4.0)), any_box(a.center, random));
    let at = |distance: f64| OrientedBox { center: a.center + way * distance, ..b };
    let (mut low, mut high) = (0.0, 80.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if a.overlaps(&at(middle)) { low = middle } else { high = middle }
    }
    at(low)
}

fn push(obstacles: &mut Obstacles, interval: usize, swept: OrientedBox) {
    let displacement = Point::default();
    obstacles.push_sweep(interval, Sweep { track: 0, radius: swept.radius(), swept, end: swept, displacement });
}

/// Obstacles with boxes around those of a sample, which may lie up to `apart` times 30 m away; some just touch it.
fn crowd(random: &mut Lcg, apart: f64) -> Obstacles {
    let mut obstacles = Obstacles { origin: FAR, ..Obstacles::default() };
    for interval in 0..3 {
        let center = FAR + Point::new(random.within(-300.0, 300.0), random.within(-300.0, 300.0));
        let step = any_box(center, random);
        obstacles.steps.push(step);
        for _ in 0..random.within(0.0, 20.0) as usize {
            let swept = if apart <= 1.0 && random.within(0.0, 1.0) < 0.4 {
                borderline(&step, random)
            } else {
                let offset = Point::from_angle(random.within(-4.0, 4.0)) * (30.0 * random.within(apart - 1.0, apart));
                any_box(center + offset, random)
            };
            push(&mut obstacles, interval, swept);
        }
    }
    obstacles.sweeps_by_interval.sort(3);
    obstacles
}

#[test]
fn the_sieve_passes_every_box_that_overlaps_and_no_filling() {
    let mut random = Lcg::new(7);
    let (mut n_overlapping, mut n_sieved) = (0, 0);
    for _ in 0..1000 {
        let obstacles = crowd(&mut random, 1.0);
        for (interval, step) in obstacles.steps.iter().enumerate() {
            let numbers = rough(step, FAR);
            let by_interval = &obstacles.sweeps_by_interval;
            let mut passes = vec![false; obstacles.sweeps.len()];
            let (first, end) = by_interval.groups(interval);
            for group in (first..end).step_by(GROUP) {
                let mut bits = by_interval.passing(group, |others, k| may_overlap(&numbers, others, k));
                let n = (by_interval.of(interval).len() - (group - first)).min(GROUP);
                assert!(bits >> n == 0, "filling passes");
                while bits != 0 {
                    passes[by_interval.number(group, bits)] = true;
                    bits &= bits - 1;
                }
            }
            for index in by_interval.of(interval) {
                let swept = &obstacles.sweeps[*index].swept;
                let overlaps = step.overlaps(swept);
                assert!(passes[*index] || !overlaps, "{step:?} and {swept:?}");
                n_overlapping += usize::from(overlaps);
                n_sieved += usize::from(!passes[*index]);
            }
        }
    }
    assert!(n_overlapping > 5000 && n_sieved > 5000, "{n_overlapping} overlap, {n_sieved} do not pass");
}

#[test]
fn wide_machines_find_the_same_first_overlap_which_is_that_of_the_boxes() {
    let mut random = Lcg::new(8);
    let mut found = [0; 4];
    for i in 0..400 {
        let obstacles = crowd(&mut random, if i % 2 == 0 { 1.0 } else { 2.0 });
        for first in 0..3 {
            let by_boxes = (first..3).find(|interval| {
                let sweeps = obstacles.sweeps_by_interval.of(*interval).iter();
                sweeps
                    .map(|index| &obstacles.sweeps[*index].swept)
                    .any(|swept| obstacles.steps[*interval].overlaps(swept))
            });
            assert_eq!(overlap_from(&obstacles, first), by_boxes);
            assert_eq!(next_overlap(&obstacles, first), by_boxes);
            found[by_boxes.unwrap_or(3)] += 1;
        }
    }
    assert!(found.iter().all(|n| *n > 30), "{found:?}");
}

#[test]
fn wide_machines_cover_the_same() {
    let mut random = Lcg::new(9);
    for n in [2, 31, 32, 33, 70] {
        let mut center = FAR;
        let points: Vec<Waypoint> = (0..n)
            .map(|_| {
                center = center + Point::new(random.within(0.0, 3.0), random.within(-0.5, 0.5));
                Waypoint { center, axis: Point::from_angle(random.within(-0.3, 0.3)), ..Waypoint::default() }
            })
            .collect();
        let (mut narrow, mut wide) = (vec![], vec![]);
        covers_at(&points, (2.254, 0.805), &mut narrow);
        cover(&points, (2.254, 0.805), &mut wide);
        assert_eq!(wide.len(), n - 1);
        let bits = |boxes: &[OrientedBox]| {
            let numbers = |b: &OrientedBox| [b.center.x, b.center.y, b.axis.x, b.axis.y, b.half_length, b.half_width];
            boxes.iter().map(|b| numbers(b).map(f64::to_bits)).collect::<Vec<_>>()
        };
        assert_eq!(bits(&wide), bits(&narrow));
    }
}
