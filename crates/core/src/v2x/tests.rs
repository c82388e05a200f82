use super::channel::arrival;
use super::message::Message;
use super::*;
use crate::right_of_way::Memory;
use crate::trajectory::State;
use crate::vehicle::ParticipantKind;

#[test]
fn reception_ends_at_the_range_or_fades() {
    let disc = V2xSettings::default();
    let fading = V2xSettings { fading: true, ..disc };
    let lossy = V2xSettings { loss: 0.25, ..disc };
    assert_eq!([300.0, 300.1].map(|d| reception(&disc, d)), [1.0, 0.0]);
    assert_eq!(reception(&lossy, 10.0), 0.75);
    let [half, full] = [150.0, 300.0].map(|d| reception(&fading, d));
    assert!((half - 0.9595).abs() < 5e-5 && (full - 0.4232).abs() < 5e-5, "{half} {full}");
}

#[test]
fn losses_of_two_receivers_have_nothing_to_do_with_each_other() {
    let settings = V2xSettings { loss: 0.3, ..V2xSettings::default() };
    let is_lost = |time_step, receiver| {
        arrival(&settings, 0, [time_step, 1, receiver, 0], reception(&settings, 50.0), 0.1).is_none()
    };
    let n = 100_000;
    let share = |lost: &dyn Fn(i64) -> bool| (0..n).filter(|k| lost(*k)).count() as f64 / n as f64;
    let (one, both) = (share(&|k| is_lost(k, 2)), share(&|k| is_lost(k, 2) && is_lost(k, 3)));
    assert!((one - 0.3).abs() < 0.005 && (both - 0.09).abs() < 0.004, "{one} {both}");
}

#[test]
fn a_message_arrives_with_the_first_step_after_its_delay_and_never_at_once() {
    for (delay, dt, steps) in [(0.0, 0.1, 1), (0.1, 0.1, 1), (0.25, 0.1, 3), (0.25, 0.2, 2), (0.3, 0.1, 3)] {
        assert_eq!(steps_to_arrival(delay, dt), steps, "{delay} s, {dt} s");
    }
}

#[test]
fn the_equipped_of_a_smaller_share_are_among_those_of_a_larger_one() {
    let ids: Vec<i64> = (0..10).map(|i| 7 * i - 20).collect();
    let of = |penetration| equipped(3, penetration, &ids);
    let mut before = of(0.0);
    assert!(before.iter().all(|is| !is));
    for (penetration, n) in [(0.25, 3), (0.5, 5), (0.75, 8), (1.0, 10)] {
        let now = of(penetration);
        assert_eq!(now.iter().filter(|is| **is).count(), n);
        assert!(before.iter().zip(&now).all(|(before, now)| now | !before), "{penetration}");
        before = now;
    }
}

#[test]
fn a_state_is_sent_when_it_has_changed_and_otherwise_once_a_second() {
    let mut sent = trigger::Sent::default();
    // At 10 m/s 4 m are exceeded after 0.5 s; then it stands.
    let x = |k: i64| if k < 20 { k as f64 } else { 20.0 };
    let state = |k: i64| State { x: x(k), velocity: 10.0, ..State::default() };
    let steps: Vec<i64> = (0..60).filter(|k| sent.cam(*k, &state(*k), 0.1)).collect();
    // The interval of the last change is kept for three messages.
    assert_eq!(steps, [0, 5, 10, 15, 20, 25, 30, 35, 45, 55]);
}

#[test]
fn an_object_is_reported_when_it_is_new_or_has_changed_or_after_a_second_and_the_longest_unreported_first() {
    let mut sent = trigger::Sent::default();
    let at = |id: i64, x: f64| {
        let state = State { x, ..State::default() };
        Object::rounded(id, ParticipantKind::Car, &state, (4.0, 2.0), false)
    };
    let mut ids = |k: i64, seen: Vec<Object>, n_max| {
        let sent = sent.objects(k, &State::default(), seen, n_max, 0.1);
        sent.iter().map(|object| object.id).collect::<Vec<_>>()
    };
    assert_eq!(ids(0, vec![at(1, 50.0), at(2, 10.0), at(3, 20.0)], 2), [2, 3]);
    assert_eq!(ids(1, vec![at(1, 50.0), at(2, 10.0), at(3, 24.5)], 1), [1]);
    assert_eq!(ids(2, vec![at(1, 50.0), at(2, 10.0), at(3, 24.5)], 9), [3]);
    assert_eq!(ids(10, vec![at(1, 50.0), at(2, 10.0), at(3, 24.5)], 9), [2]);
}

/// A plan of 16 points and a way of 21, with a request or without.
fn plan(request: Option<Memory>) -> Message {
    let payload = Payload::Mcm {
        status: Object::rounded(1, ParticipantKind::Car, &State::default(), (4.53, 1.8), false),
        is_emergency: false,
        spacing: 0.2,
        points: vec![State::default(); 16],
        way: vec![State::default(); 21],
        way_from: 0.0,
        request,
    };
    Message { time_step: 0, sender: 1, payload }
}

#[test]
fn a_plan_that_is_too_long_loses_its_way_first() {
    let cut = |max_bytes| {
        let mut message = plan(None);
        message.cut(max_bytes);
        assert!(message.bytes() <= max_bytes);
        let Payload::Mcm { points, way, .. } = message.payload else { unreachable!() };
        (points.len(), way.len())
    };
    assert_eq!(cut(1100), (16, 21));
    assert_eq!(cut(478), (16, 21));
    assert_eq!(cut(470), (16, 20));
    assert_eq!(cut(300), (15, 0));
}

#[test]
fn a_request_counts_and_is_never_cut() {
    let mut message = plan(Some(Memory::default()));
    assert_eq!((plan(None).bytes(), message.bytes()), (478, 478 + 8));
    message.cut(300);
    let Payload::Mcm { points, way, request, .. } = message.payload else { unreachable!() };
    assert_eq!((points.len(), way.len(), request), (14, 0, Some(Memory::default())));
}

#[test]
fn a_request_is_news_when_it_is_another_one_or_is_granted_and_not_because_its_sender_stands() {
    let mut sent = trigger::Sent::default();
    let request = Memory { passage: 1, ticket: Some(7), ..Memory::default() };
    assert!(sent.is_request_news(Some(&request)));
    sent.note_plan(0, &[], 0.2, Some(request));
    assert!(!sent.is_request_news(Some(&Memory { standing: 5, ..request })));
    assert!(sent.is_request_news(Some(&Memory { granted: Some(true), ..request })));
    assert!(sent.is_request_news(Some(&Memory { passage: 2, ..request })) && sent.is_request_news(None));
}

#[test]
fn an_older_message_that_arrives_later_is_dropped_and_old_ones_are_forgotten() {
    let mut inbox = inbox::Inbox::new(2);
    let message = |time_step: i64| {
        let status = Object::rounded(1, ParticipantKind::Car, &State::default(), (4.5, 1.8), false);
        std::sync::Arc::new(Message { time_step, sender: 1, payload: Payload::Cam(status) })
    };
    let newest = |inbox: &inbox::Inbox| inbox.heard[1][0].as_ref().map(|message| message.time_step);
    [3, 5, 4].into_iter().for_each(|time_step| inbox.file(1, &message(time_step)));
    assert_eq!(newest(&inbox), Some(5));
    inbox.forget(5);
    assert_eq!(newest(&inbox), Some(5));
    inbox.forget(6);
    assert_eq!(newest(&inbox), None);
}
