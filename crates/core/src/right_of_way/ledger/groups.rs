//! Orders of all travellers at a time step: whose ledgers belong together, and which bodies each of them knows.

use super::{Ahead, Ledger};
use crate::right_of_way::traffic::{Order, Traffic};
use crate::right_of_way::zones::reach;

impl Traffic<'_> {
    /// The orders of all travellers that are near a passage, by ids. `sees` says whether the body at the first position
    /// sees that at the second one.
    pub fn orders(&self, sees: &dyn Fn(usize, usize) -> bool) -> Vec<Order> {
        let clusters = self.clusters();
        let mut is_wanted: Vec<bool> = self.travellers.iter().map(|traveller| self.is_stuck(traveller)).collect();
        clusters.iter().flatten().for_each(|member| is_wanted[*member] = true);
        let queues = self.queues(&is_wanted);
        let mut orders = Vec::new();
        for members in clusters {
            let concerned = self.concerned(&members, &queues);
            let mut ledgers: Vec<(Vec<usize>, Vec<Option<Order>>)> = Vec::new();
            let mut known: Vec<usize> = Vec::with_capacity(concerned.len());
            for (place, &member) in members.iter().enumerate() {
                let viewer = self.travellers[member].body;
                let is_known = |body: &usize| *body == viewer || sees(viewer, *body);
                known.clear();
                known.extend(concerned.iter().copied().filter(is_known));
                // Agents that see the same bodies keep the same ledger.
                let order = if let Some((_, found)) = ledgers.iter().find(|(same, _)| *same == known) {
                    found[place]
                } else {
                    let found = Ledger::new(self, &known, &queues).decide(&members);
                    let order = found[place];
                    ledgers.push((known.clone(), found));
                    order
                };
                orders.extend(order);
            }
        }
        orders.sort_by_key(|order| order.id);
        self.break_circles(&mut orders, &queues);
        orders
    }

    /// The order of one traveller that knows of all this traffic.
    pub fn order_of(&self, viewer: usize) -> Option<Order> {
        let members = self.clusters().into_iter().find(|members| members.contains(&viewer))?;
        let mut is_wanted: Vec<bool> = self.travellers.iter().map(|traveller| self.is_stuck(traveller)).collect();
        members.iter().for_each(|member| is_wanted[*member] = true);
        let queues = self.queues(&is_wanted);
        let known = self.concerned(&members, &queues);
        let mut orders: Vec<Order> =
            Ledger::new(self, &known, &queues).decide(&members).into_iter().flatten().collect();
        self.break_circles(&mut orders, &queues);
        let id = self.bodies[self.travellers[viewer].body].id;
        orders.into_iter().find(|order| order.id == id)
    }

    /// Bodies that may change the orders of a group of travellers.
    fn concerned(&self, members: &[usize], queues: &[Vec<Ahead>]) -> Vec<usize> {
        let own = members.iter().map(|index| self.travellers[*index].body);
        let ahead = members.iter().flat_map(|index| queues[*index].iter().map(|one| one.body));
        let zones = members.iter().flat_map(|index| self.travellers[*index].course.zones());
        let mut crossed: Vec<usize> = zones.map(|zone| zone.area).collect();
        crossed.sort_unstable();
        let is_crossed = |area: usize| crossed.binary_search(&area).is_ok();
        let visiting = self.visits.iter().filter(|visit| is_crossed(visit.zone.area)).map(|visit| visit.body);
        let mut is_concerned = vec![false; self.bodies.len()];
        own.chain(ahead).chain(visiting).for_each(|body| is_concerned[body] = true);
        (0..self.bodies.len()).filter(|body| is_concerned[*body]).collect()
    }

    /// Travellers near a passage, in groups whose passages belong to the same junctions.
    fn clusters(&self) -> Vec<Vec<usize>> {
        let mut clusters: Vec<(Vec<usize>, Vec<usize>)> = Vec::new();
        for (index, traveller) in self.travellers.iter().enumerate() {
            let body = &self.bodies[traveller.body];
            let reach = reach(body.velocity);
            let passages = &traveller.course.passages[traveller.course.first_passage(traveller.front - body.length)..];
            let near = passages.iter().take_while(|passage| passage.entry_line - traveller.front <= reach);
            let mut numbers: Vec<usize> = near.flat_map(|passage| passage.junctions.iter().copied()).collect();
            if numbers.is_empty() {
                continue;
            }
            let mut members = vec![index];
            clusters.retain_mut(|(others, theirs)| {
                let is_apart = !theirs.iter().any(|number| numbers.contains(number));
                if !is_apart {
                    members.append(others);
                    numbers.append(theirs);
                }
                is_apart
            });
            members.sort_unstable();
            clusters.push((members, numbers));
        }
        clusters.into_iter().map(|(members, _)| members).collect()
    }
}
