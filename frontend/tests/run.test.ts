import assert from "node:assert/strict";
import { test } from "node:test";
import type { Participant, RunHeader } from "../src/contract";
import { Run } from "../src/run";
import { costRange } from "../src/traffic";
import { packed } from "./packed";

/** Agent 7 drives to the right, 2 m per step for 4 steps; recorded vehicle 9 stands from step 1 on. */
function driven(dt = 0.1): Promise<Run> {
  const [arrays, text] = packed({
    valid: { shape: [2, 4], values: [1, 1, 1, 1, 0, 1, 1, 1] },
    x: { shape: [2, 4], values: [0, 2, 4, 6, NaN, 30, 30, 30] },
    y: { shape: [2, 4], values: [0, 0, 0, 0, NaN, 5, 5, 5] },
    orientation: { shape: [2, 4], values: [0, 0, 0, 0, NaN, 0, 0, 0] },
    velocity: { shape: [2, 4], values: [20, 20, 20, 20, NaN, 0, 0, 0] },
    plan_participant: { shape: [2], values: [0, 0] },
    plan_step: { shape: [2], values: [0, 2] },
    plan_made: { shape: [2], values: [0, 2] },
    candidate_participant: { shape: [4], values: [0, 0, 0, 0] },
    candidate_step: { shape: [4], values: [0, 0, 0, 3], spacing: 2 },
    candidate_cost: { shape: [4], values: [5, 1, 3, NaN] },
    candidate_reason: { shape: [4], values: [0, 0, 1, 0] },
    prediction_step: { shape: [3], values: [0, 0, 1] },
    measure: { shape: [2, 1, 4], values: [9, 3, 9, 9, 9, 9, 2, 9] },
    measure_partner: { shape: [2, 1, 4], values: [-1, 1, -1, -1, -1, 1, 1, -1] },
    view_observer: { shape: [1], values: [0] },
    view_seen: { shape: [1], values: [1] },
    view_first: { shape: [1], values: [1] },
    view_last: { shape: [1], values: [2] },
  });
  const vehicle = { kind: "car", length: 4, width: 2, static: false };
  const participants: Participant[] = [
    { ...vehicle, id: 7, agent: 0, end: 3, outcome: "goal_reached" },
    { ...vehicle, id: 9, agent: -1 },
  ];
  const measures = [{ name: "ttc" }, { name: "pet" }];
  const header = { dt, first_time_step: 10, n_steps: 4, participants, measures, arrays } as unknown as RunHeader;
  return Run.read(header, text);
}

test("between two steps a vehicle is between its places", async () => {
  const run = await driven();
  assert.equal(run.pose(0, 1.5)?.x, 3);
  assert.equal(run.pose(1, 0.9), undefined);
  assert.equal(run.lastPose(0, 99)?.x, 6);
});

test("a plan is followed until the next one is made", async () => {
  const run = await driven();
  assert.deepEqual(
    [0, 1, 2, 3].map((step) => run.plan(0, step)),
    [0, 0, 1, 1],
  );
  assert.deepEqual(
    [0, 1, 2, 3].map((step) => run.madeAt(0, step)),
    [0, 0, 2, 2],
  );
  assert.equal(run.plan(1, 2), -1);
});

test("candidates are shown as long as their spacing lasts", async () => {
  const run = await driven();
  assert.deepEqual(
    [0, 1, 2, 3].map((step) => run.candidates(0, step)),
    [
      [0, 3],
      [0, 3],
      [0, 0],
      [3, 4],
    ],
  );
});

test("costs range over candidates that were not rejected", async () => {
  const run = await driven();
  assert.deepEqual(costRange(run, 0, 3), [1, 1]);
  assert.equal(costRange(run, 3, 4), undefined);
});

test("conflict partners are those of any measure", async () => {
  const run = await driven();
  assert.deepEqual(
    [0, 1, 2].map((step) => [...(run.partners(0, step) ?? [])]),
    [[], [1], [1]],
  );
  assert.equal(run.partners(1, 1), undefined);
});

test("visible participants are known per time step until the agent ends", async () => {
  const run = await driven();
  assert.deepEqual(
    [0, 1, 2, 3].map((step) => run.seen(0, step)?.size),
    [0, 1, 1, undefined],
  );
  assert.deepEqual(run.predictions(0), [0, 2]);
});

test("times have the decimals that tell steps apart", async () => {
  assert.equal((await driven(0.1)).time(2), "1.2 s");
  assert.equal((await driven(0.04)).time(2), "0.48 s");
});
