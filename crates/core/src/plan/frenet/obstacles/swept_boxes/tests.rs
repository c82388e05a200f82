use super::*;
use crate::geometry::shape::{Lcg, OrientedBox};
use crate::geometry::{Aabb, Point, Pose};

/// Where maps in UTM coordinates are [m].
const FAR: Point = Point { x: 5e5, y: 5.3e6 };
/// Points of a plan, and intervals with padding.
const N_POINTS: usize = 13;
const STRIDE: usize = 16;

/// A body, from a pedestrian to a long trailer, that drives somewhere.
fn drive(from: Point, random: &mut Lcg) -> Vec<OrientedBox> {
    let (length, width) = [(0.5, 0.5), (4.5, 1.8), (18.0, 2.6), (60.0, 4.0)][random.within(0.0, 4.0) as usize];
    let (mut position, mut orientation) = (from, random.within(-4.0, 4.0));
    (0..N_POINTS)
        .map(|_| {
            orientation += random.within(-0.1, 0.1);
            position = position + Point::from_angle(orientation) * random.within(-0.5, 3.0);
            OrientedBox::new(Pose { position, orientation }, length, width)
        })
        .collect()
}

fn poses(drive: &[OrientedBox]) -> Poses {
    let mut poses = Poses::default();
    poses.begin(STRIDE);
    for (point, body) in drive.iter().enumerate() {
        poses.set(point, body.center - FAR, body.axis);
    }
    poses
}

fn half(drive: &[OrientedBox]) -> (f64, f64) {
    (drive[0].half_length, drive[0].half_width)
}

/// A drive moved along a direction to where it just overlaps another one during some interval.
fn borderline(own: &[OrientedBox], random: &mut Lcg) -> Vec<OrientedBox> {
    let (way, other) = (Point::from_angle(random.within(-4.0, 4.0)), drive(own[0].center, random));
    let interval = random.within(0.0, (N_POINTS - 1) as f64) as usize;
    let at = |distance: f64| -> Vec<OrientedBox> {
        other.iter().map(|body| OrientedBox { center: body.center + way * distance, ..*body }).collect()
    };
    let (mut low, mut high) = (0.0, 120.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if swept(own, interval).overlaps(&swept(&at(middle), interval)) { low = middle } else { high = middle }
    }
    at(low)
}

fn swept(drive: &[OrientedBox], interval: usize) -> OrientedBox {
    OrientedBox::spanning(&drive[interval], &drive[interval + 1])
}

fn everywhere() -> Reach {
    let mut reach = Reach::default();
    reach.begin(Pose { position: FAR, orientation: 0.7 }, N_POINTS);
    for point in 1..N_POINTS {
        reach.set(point, Aabb::around([Point::default()]).grown(2000.0));
    }
    reach
}

/// A sample and others around it.
fn crowd(random: &mut Lcg) -> (Vec<OrientedBox>, Vec<Vec<OrientedBox>>) {
    let own = drive(FAR + Point::new(random.within(-300.0, 300.0), random.within(-300.0, 300.0)), random);
    let others = (0..random.within(0.0, 12.0) as usize)
        .map(|_| {
            if random.within(0.0, 1.0) < 0.5 {
                return borderline(&own, random);
            }
            drive(own[5].center + Point::new(random.within(-30.0, 30.0), random.within(-30.0, 30.0)), random)
        })
        .collect();
    (own, others)
}

#[test]
fn the_sieve_finds_every_overlap_in_order_and_nothing_beyond_what_is_known() {
    let mut random = Lcg::new(7);
    let (reach, mut swept_boxes, mut single) = (everywhere(), SweptBoxes::default(), SweptBoxes::default());
    let (mut n_overlapping, mut n_sieved) = (0, 0);
    for _ in 0..600 {
        let (own, others) = crowd(&mut random);
        swept_boxes.begin(STRIDE);
        for other in &others {
            assert!(swept_boxes.push(&poses(other), half(other), &reach), "everything is in reach");
        }
        single.set(STRIDE, &poses(&own), half(&own));
        let any = swept_boxes.broad_phase(&single);
        let found: Vec<(usize, usize)> = swept_boxes.found().collect();
        assert_eq!(any, !found.is_empty());
        assert!(found.is_sorted() && found.iter().all(|(interval, _)| *interval < N_POINTS - 1));
        for interval in 0..N_POINTS - 1 {
            for (body, other) in others.iter().enumerate() {
                let overlaps = swept(&own, interval).overlaps(&swept(other, interval));
                let passes = found.contains(&(interval, body));
                assert!(passes || !overlaps, "{:?} and {:?}", swept(&own, interval), swept(other, interval));
                n_overlapping += usize::from(overlaps);
                n_sieved += usize::from(!passes);
            }
        }
    }
    assert!(n_overlapping > 5000 && n_sieved > 5000, "{n_overlapping} overlap, {n_sieved} do not pass");
}

#[test]
fn boxes_are_those_of_double_precision() {
    let mut random = Lcg::new(8);
    for _ in 0..300 {
        let own = drive(FAR + Point::new(random.within(-300.0, 300.0), 0.0), &mut random);
        let mut swept_boxes = SweptBoxes::default();
        swept_boxes.set(STRIDE, &poses(&own), half(&own));
        for interval in 0..N_POINTS - 1 {
            let boxes = &swept_boxes.boxes[interval / GROUP];
            let [x, y, axis_x, axis_y, half_length, half_width] = boxes.map(|row| f64::from(row[interval % GROUP]));
            let exact = swept(&own, interval);
            let center = FAR + Point::new(x, y);
            assert!(center.distance(exact.center) < 2e-4, "{center:?} {exact:?}");
            assert!(Point::new(axis_x, axis_y).distance(exact.axis) < 2e-6);
            assert!((half_length - exact.half_length).abs() < 2e-4 && (half_width - exact.half_width).abs() < 2e-4);
        }
    }
}

#[test]
fn a_body_out_of_reach_is_left_out_and_one_that_gets_there_is_not() {
    let agent = Pose { position: FAR, orientation: 0.7 };
    let mut reach = Reach::default();
    reach.begin(agent, N_POINTS);
    for point in 1..N_POINTS {
        // 10 m further at every point.
        let ahead = Point::new(10.0 * point as f64, 0.0);
        reach.set(point, Aabb::around([Point::default(), ahead]).grown(2.0));
    }
    assert!(reach.whole().contains(agent.world_from_body(Point::new(121.9, 1.9))));
    assert!(!reach.whole().contains(agent.world_from_body(Point::new(121.9, 2.1))));
    let standing = |ahead: f64, left: f64| {
        let mut poses = Poses::default();
        let pose = Pose { position: agent.world_from_body(Point::new(ahead, left)), ..agent };
        poses.stand(STRIDE, &OrientedBox::new(pose, 4.0, 2.0), FAR);
        poses
    };
    let mut swept_boxes = SweptBoxes::default();
    swept_boxes.begin(STRIDE);
    assert!(!swept_boxes.push(&standing(50.0, 3.1), (2.0, 1.0), &reach));
    assert!(swept_boxes.push(&standing(50.0, 2.9), (2.0, 1.0), &reach));
    assert!(swept_boxes.push(&standing(123.0, 0.0), (2.0, 1.0), &reach), "at the last point");
    assert!(!swept_boxes.push(&standing(125.0, 0.0), (2.0, 1.0), &reach));
    assert_eq!(swept_boxes.counts, [true, true, false, true]);
}

#[test]
fn wide_machines_find_the_same() {
    let mut random = Lcg::new(9);
    let reach = everywhere();
    let mut n_found = 0;
    for _ in 0..300 {
        let (own, others) = crowd(&mut random);
        let (mut wide, mut narrow) = (SweptBoxes::default(), SweptBoxes::default());
        let mut single = SweptBoxes::default();
        single.set(STRIDE, &poses(&own), half(&own));
        wide.begin(STRIDE);
        narrow.begin(STRIDE);
        for other in &others {
            let size = [half(other).0 as f32, half(other).1 as f32];
            write_boxes(&mut wide, &poses(other), size, Some(&reach));
            boxes_at(&mut narrow, &poses(other), size, Some(&reach));
        }
        let bits = |swept_boxes: &SweptBoxes| {
            swept_boxes.boxes.iter().flatten().flatten().map(|number| number.to_bits()).collect::<Vec<_>>()
        };
        assert_eq!(bits(&wide), bits(&narrow));
        assert_eq!(find_overlaps(&mut wide, &single), overlaps_of(&mut narrow, &single));
        assert_eq!(wide.found, narrow.found);
        n_found += wide.found().count();
    }
    assert!(n_found > 2000, "{n_found}");
}
