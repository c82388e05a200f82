//! The bodies on the paths of travellers.

use super::Ahead;
use crate::right_of_way::traffic::{Traffic, Traveller};
use crate::right_of_way::zones::{Course, Place};

impl Traffic<'_> {
    /// For some travellers the bodies on their paths, the nearest rear first; none for the others.
    pub(super) fn queues(&self, is_wanted: &[bool]) -> Vec<Vec<Ahead>> {
        let numbered = self.bodies.iter().enumerate();
        let mut on: Vec<(usize, usize)> =
            numbered.flat_map(|(body, one)| one.places.iter().map(move |place| (place.lanelet, body))).collect();
        on.sort_unstable();
        let mut near: Vec<usize> = Vec::new();
        let queue = |(traveller, is_wanted): (&Traveller<'_>, &bool)| {
            near.clear();
            for piece in if *is_wanted { &*traveller.course.pieces } else { &[] } {
                let from = on.partition_point(|(lanelet, _)| *lanelet < piece.lanelet);
                near.extend(on[from..].iter().take_while(|one| one.0 == piece.lanelet).map(|one| one.1));
            }
            near.sort_unstable();
            near.dedup();
            let others = near.iter().copied().filter(|body| *body != traveller.body);
            let mut queue = Vec::with_capacity(near.len().saturating_sub(1));
            queue.extend(others.filter_map(|body| {
                let front = self.front_on(traveller.course, body, traveller.front)?;
                Some(Ahead { front, rear: front - self.bodies[body].length, body })
            }));
            queue.sort_unstable_by(|a, b| a.rear.total_cmp(&b.rear).then(a.body.cmp(&b.body)));
            queue
        };
        self.travellers.iter().zip(is_wanted).map(queue).collect()
    }

    /// Arc length of the front of a body on a path [m], if it is on one of its lanelets.
    fn front_on(&self, course: &Course, body: usize, from: f64) -> Option<f64> {
        let length = self.bodies[body].length;
        let on = |place: &Place| {
            let at = course.place(place.lanelet, place.s, from - length)?;
            Some(at + place.to_front)
        };
        self.bodies[body].places.iter().find_map(on)
    }
}
