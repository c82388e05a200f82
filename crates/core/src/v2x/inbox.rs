//! What an agent has received: of each sender and service the newest message.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::sync::Arc;

use super::message::{Message, Object, Payload};

/// Messages that an agent has received.
#[derive(Debug, Clone, Default)]
pub(super) struct Inbox {
    /// Newest state and newest plan, by the sender's place among the equipped agents.
    pub(super) heard: Vec<[Option<Arc<Message>>; 2]>,
    /// Newest report by object, with its time step and sender; of equally new reports, the sender with the smaller id
    /// counts.
    pub(super) objects: BTreeMap<i64, (i64, usize, Object)>,
}

impl Inbox {
    pub(super) fn new(n: usize) -> Self {
        Self { heard: vec![[None, None]; n], objects: BTreeMap::new() }
    }

    /// Keeps a message unless a newer one of the same kind is here.
    pub(super) fn file(&mut self, sender: usize, message: &Arc<Message>) {
        let [cam, mcm] = &mut self.heard[sender];
        let kept = match &message.payload {
            Payload::Cam(_) => cam,
            Payload::Mcm { .. } => mcm,
            Payload::Cpm(objects) => {
                for object in objects {
                    let new = (message.time_step, sender, *object);
                    let kept = self.objects.entry(object.id).or_insert(new);
                    if (kept.0, Reverse(kept.1)) < (new.0, Reverse(sender)) {
                        *kept = new;
                    }
                }
                return;
            }
        };
        if kept.as_ref().is_none_or(|kept| kept.time_step < message.time_step) {
            *kept = Some(Arc::clone(message));
        }
    }

    /// Forgets what was sent before a time step.
    pub(super) fn forget(&mut self, before: i64) {
        for kept in self.heard.iter_mut().flatten() {
            if kept.as_ref().is_some_and(|message| message.time_step < before) {
                *kept = None;
            }
        }
        self.objects.retain(|_, (time_step, ..)| *time_step >= before);
    }
}
