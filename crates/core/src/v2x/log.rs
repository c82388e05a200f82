//! Which messages were sent and received, as far as it is recorded, and totals.

use super::message::Service;
use crate::columns::table;
use crate::geometry::Pose;

/// How much of the messages is recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Logged {
    /// Totals.
    #[default]
    None,
    /// One row per message.
    Sent,
    /// Besides, one row per message and receiver in range.
    Links,
}

table! {
    /// A message, or its way to one receiver.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Row {
        /// Time step of sending.
        pub time_step: i64,
        /// Id of the sender.
        pub sender as "sender_id": i64,
        /// Its service.
        pub service: Service,
        /// Its size [B].
        pub bytes: usize,
        /// Number of objects in it.
        pub objects: usize,
        /// Number of points of its plan.
        pub points: usize,
        /// Number of receivers within range.
        pub in_range: usize,
        /// Number of receivers that it reaches.
        pub received: usize,
        /// Id of the receiver; `None` in the row of the message itself.
        pub receiver as "receiver_id": Option<i64>,
        /// Time step of arrival there; `None`: lost, or the row of the message itself.
        pub arrived: Option<i64>,
        /// Distance of the receiver [m]; NaN in the row of the message itself.
        pub distance: f64,
    }
}

table! {
    /// A stretch of time steps in which an agent holds for another.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Agreement {
        /// Id of the agent that holds.
        pub holding as "holding_id": i64,
        /// Id of the agent that goes; `None`: the way is blocked by what has no V2X.
        pub going as "going_id": Option<i64>,
        /// First time step.
        pub first as "first_time_step": i64,
        /// Last time step.
        pub last as "last_time_step": i64,
        /// Where it holds at the first time step.
        pub bar: Pose,
    }
}

/// What is recorded about messages.
#[derive(Debug, Clone, Default)]
pub struct Log {
    pub(super) level: Logged,
    /// Rows by time step, sender, service, and receiver, that of the message itself first.
    pub rows: Vec<Row>,
    /// Messages by service.
    pub messages: [usize; 3],
    /// Bytes by service.
    pub bytes: [usize; 3],
    /// Pairs of message and receiver within range.
    pub in_range: usize,
    /// Those of them in which the message gets through.
    pub received: usize,
    /// Most bytes that one agent heard in one time step.
    pub peak_bytes: usize,
}

impl Log {
    /// Notes a message and its links, which are in the order of the receivers.
    pub(super) fn note(&mut self, row: Row, links: &[(i64, Option<i64>, f64)]) {
        let service = row.service as usize;
        self.messages[service] += 1;
        self.bytes[service] += row.bytes;
        self.in_range += row.in_range;
        self.received += row.received;
        if self.level != Logged::None {
            self.rows.push(row);
        }
        if self.level == Logged::Links {
            let rows =
                links.iter().map(|&(id, arrived, distance)| Row { receiver: Some(id), arrived, distance, ..row });
            self.rows.extend(rows);
        }
    }
}
