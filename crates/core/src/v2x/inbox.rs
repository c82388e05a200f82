//! What an agent has received: of each sender and service the newest message.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::message::{Body, Message, Object};

/// Newest messages of a sender.
#[derive(Debug, Clone, Default)]
pub(super) struct Heard {
    pub(super) cam: Option<Arc<Message>>,
    pub(super) mcm: Option<Arc<Message>>,
}

/// Messages that an agent has received.
#[derive(Debug, Clone, Default)]
pub(super) struct Inbox {
    /// By the sender's place among the equipped agents.
    pub(super) heard: Vec<Heard>,
    /// Newest report by object and sender, with its time step.
    pub(super) objects: BTreeMap<(i64, usize), (i64, Object)>,
}

impl Inbox {
    pub(super) fn new(n: usize) -> Self {
        Self { heard: vec![Heard::default(); n], objects: BTreeMap::new() }
    }

    /// Keeps a message unless a newer one of the same kind is here.
    pub(super) fn file(&mut self, sender: usize, message: &Arc<Message>) {
        let heard = &mut self.heard[sender];
        let kept = match &message.body {
            Body::Cam(_) => &mut heard.cam,
            Body::Mcm { .. } => &mut heard.mcm,
            Body::Cpm(objects) => {
                for object in objects {
                    let (time_step, kept) =
                        self.objects.entry((object.id, sender)).or_insert((message.time_step, *object));
                    if *time_step < message.time_step {
                        (*time_step, *kept) = (message.time_step, *object);
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
        for heard in &mut self.heard {
            for kept in [&mut heard.cam, &mut heard.mcm] {
                if kept.as_ref().is_some_and(|message| message.time_step < before) {
                    *kept = None;
                }
            }
        }
        self.objects.retain(|_, (time_step, _)| *time_step >= before);
    }
}
