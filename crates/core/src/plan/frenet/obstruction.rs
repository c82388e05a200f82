//! Why no sample is admissible: what rejected most of the samples that the vehicle can drive.

use super::evaluation::Evaluation;
use super::feasibility::Rejection;
use crate::geometry::Point;
use crate::trajectory::Obstruction;

/// After a search that rejected every sample. Contacts with one participant count together; the first of equals counts.
pub(super) fn find(evaluation: &mut Evaluation) -> Obstruction {
    let memory = &*evaluation.tables.memory;
    let mut hits = vec![0_usize; evaluation.problem.request.others.len()];
    memory.contacts.iter().for_each(|(_, contact)| hits[contact.other] += 1);
    let (other, most) = first_of_most(&hits);
    if memory.n_off_road > most {
        off_road(evaluation)
    } else if most > 0 {
        contact(evaluation, other)
    } else {
        limits(evaluation)
    }
}

/// The samples hit a participant: where the first of them does.
fn contact(evaluation: &mut Evaluation, other: usize) -> Obstruction {
    let contacts = evaluation.tables.memory.contacts.iter().filter(|(_, contact)| contact.other == other);
    let (sample, contact) = *contacts.min_by_key(|(sample, _)| *sample).expect("there is a contact");
    evaluation.write_if_drivable(sample as usize);
    let request = evaluation.problem.request;
    let words = Rejection::Collision.words(request.predictions.ids[request.others[other].row]);
    Obstruction { at: evaluation.points()[contact.interval + 1].center, ..Obstruction::nowhere(&words) }
}

/// The samples leave the road: where the cheapest of them is furthest outside.
fn off_road(evaluation: &mut Evaluation) -> Obstruction {
    evaluation.write_if_drivable(evaluation.tables.memory.off_road_sample);
    let request = evaluation.problem.request;
    let (overhang, at) = evaluation.points().iter().fold((f64::NEG_INFINITY, Point::default()), |furthest, point| {
        let overhang = request.road.overhang(request.shape, point.pose(), &mut Vec::new());
        if overhang > furthest.0 { (overhang, point.center) } else { furthest }
    });
    Obstruction { rejection: Rejection::OffRoad.words(-1), at, overhang }
}

/// The vehicle can drive none of the samples: which limit they exceed first.
fn limits(evaluation: &mut Evaluation) -> Obstruction {
    let mut counts = [0; Rejection::ALL.len()];
    for sample in 0..evaluation.len() {
        counts[evaluation.write_points(sample) as usize] += 1;
    }
    counts[Rejection::Admissible as usize] = 0;
    Obstruction::nowhere(&Rejection::ALL[first_of_most(&counts).0].words(-1))
}

/// Place and size of the largest count.
fn first_of_most(counts: &[usize]) -> (usize, usize) {
    let largest = counts.iter().copied().enumerate().rev().max_by_key(|(_, count)| *count);
    largest.unwrap_or((0, 0))
}
