//! Circles of agents that wait for each other: which of them may enter although there is no room behind its passage.

use super::Ahead;
use super::components::components;
use crate::conduct::STANDSTILL_SPEED;
use crate::right_of_way::traffic::{Order, OrderKind, Traffic, Traveller};

/// One that stands this near behind another vehicle waits for it [m].
const NEAR_DISTANCE: f64 = 3.0;
/// No second exception in the same circle within this time [s].
const EXCEPTION_TIME: f64 = 10.0;

impl Traffic<'_> {
    /// In every circle of agents that wait for each other one may enter although there is no room behind.
    pub(super) fn break_circles(&self, orders: &mut [Order], queues: &[Vec<Ahead>]) {
        let is_stuck = |index: &usize| self.is_stuck(&self.travellers[*index]);
        let stuck: Vec<usize> = (0..self.travellers.len()).filter(is_stuck).collect();
        if stuck.len() < 2 {
            return;
        }
        let node = |id: i64| stuck.iter().position(|index| self.bodies[self.travellers[*index].body].id == id);
        let order_of = |orders: &[Order], index: usize| {
            let id = self.bodies[self.travellers[index].body].id;
            orders.iter().position(|order| order.id == id)
        };
        let edges: Vec<Vec<usize>> = stuck
            .iter()
            .map(|&index| {
                let by = order_of(orders, index).and_then(|place| orders[place].barrier?.by).and_then(node);
                let leader = self.leader(index, queues).and_then(|body| node(self.bodies[body].id));
                by.into_iter().chain(leader).collect()
            })
            .collect();
        for component in components(&edges).into_iter().filter(|component| component.len() > 1) {
            let members: Vec<usize> = component.iter().filter_map(|node| order_of(orders, stuck[*node])).collect();
            let recent = |place: &&usize| {
                let since = orders[**place].memory.exception;
                since.is_some_and(|since| ((self.time_step - since) as f64) * self.dt < EXCEPTION_TIME)
            };
            if members.iter().any(|place| recent(&place)) {
                continue;
            }
            let held = members
                .iter()
                .filter(|place| orders[**place].kind == OrderKind::Exit && orders[**place].memory.exception.is_none());
            let first = held.min_by_key(|place| (orders[**place].memory.arrival(), orders[**place].id));
            if let Some(&place) = first {
                orders[place].memory.exception = Some(self.time_step);
            }
        }
    }

    /// It has stood for long.
    pub(super) fn is_stuck(&self, traveller: &Traveller<'_>) -> bool {
        let needed = traveller.settings.circle_after / self.dt;
        self.bodies[traveller.body].velocity < STANDSTILL_SPEED && traveller.memory.standing as f64 >= needed
    }

    /// The nearest body ahead on the path of a traveller, if it is near.
    fn leader(&self, index: usize, queues: &[Vec<Ahead>]) -> Option<usize> {
        let front = self.travellers[index].front;
        let nearest = queues[index].iter().find(|one| one.front > front);
        nearest.filter(|one| one.rear - front < NEAR_DISTANCE).map(|one| one.body)
    }
}
