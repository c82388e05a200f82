//! Contact checks of one step: single pairs, and crowds of 24, 100 and 1000 cars.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use interdrive_core::collision::{Mover, contacts, first_contact};
use interdrive_core::geometry::Pose;
use interdrive_core::geometry::shape::{OrientedBox, Shape};
use std::hint::black_box;

fn pairs(c: &mut Criterion) {
    let car = Shape::rectangle(4.5, 1.8);
    let origin = Pose::new(0.0, 0.0, 0.0);
    let mut group = c.benchmark_group("first_contact");
    for (name, b0, b1) in [
        ("far away", Pose::new(30.0, 0.0, 0.0), Pose::new(31.0, 0.0, 0.02)),
        ("following", Pose::new(6.0, 0.2, 0.0), Pose::new(7.4, 0.2, 0.02)),
        ("oncoming lane", Pose::new(4.0, 3.0, 3.1), Pose::new(1.0, 3.0, 3.12)),
        ("crossing, hit", Pose::new(3.0, -4.0, 1.5), Pose::new(3.0, 1.0, 1.6)),
    ] {
        let a1 = Pose::new(1.5, 0.0, 0.01);
        group.bench_function(name, |b| {
            b.iter(|| first_contact(&car, black_box(origin), black_box(a1), &car, black_box(b0), black_box(b1)));
        });
    }
    group.finish();
    let boxes = [OrientedBox::new(origin, 4.5, 1.8), OrientedBox::new(Pose::new(3.8, 1.9, 0.2), 4.5, 1.8)];
    c.bench_function("oriented boxes", |b| b.iter(|| black_box(&boxes[0]).overlaps(black_box(&boxes[1]))));
    c.bench_function("spanning box", |b| b.iter(|| OrientedBox::spanning(black_box(&boxes[0]), black_box(&boxes[1]))));
    let next = Pose::new(3.8, 1.9, 0.2);
    c.bench_function("shape overlap", |b| b.iter(|| car.overlaps(black_box(origin), &car, black_box(next))));
    c.bench_function("shape distance", |b| b.iter(|| car.distance(black_box(origin), &car, black_box(next))));
}

fn crowds(c: &mut Criterion) {
    let car = Shape::rectangle(4.5, 1.8);
    let mut group = c.benchmark_group("contacts");
    for n in [24, 100, 1000] {
        // Eight lanes, four in either direction, a car every 20 m, 15 m/s for 0.1 s.
        let movers: Vec<Mover> = (0..n)
            .map(|i| {
                let (lane, place) = ((i % 8) as f64, (i / 8) as f64);
                let (heading, step) = if i % 8 < 4 { (0.01, 1.5) } else { (-3.13, -1.5) };
                let from = Pose::new(20.0 * place + 2.5 * lane, 3.5 * lane, heading);
                Mover { shape: &car, from, to: Pose::new(from.position.x + step, from.position.y, heading + 0.01) }
            })
            .collect();
        group.bench_with_input(BenchmarkId::new("traffic", n), &movers, |b, movers| {
            b.iter(|| contacts(black_box(movers), |_| true));
        });
    }
    group.finish();
}

criterion_group!(benches, pairs, crowds);
criterion_main!(benches);
