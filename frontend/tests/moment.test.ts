import assert from "node:assert/strict";
import { test } from "node:test";
import { readMoment, writeMoment } from "../src/moment";

test("an address says time and agent, either or none", () => {
  assert.deepEqual(readMoment("#t=3.5&agent=1006"), { seconds: 3.5, agent: 1006 });
  assert.deepEqual(readMoment("#t=3.5"), { seconds: 3.5 });
  assert.deepEqual(readMoment("#agent=-7"), { agent: -7 });
  assert.deepEqual(readMoment(""), {});
});

test("what is no number asks for nothing", () => {
  assert.deepEqual(readMoment("#t=soon&agent=me"), { agent: null });
  assert.deepEqual(readMoment("#t=&x=1"), {});
  assert.deepEqual(readMoment("#t=Infinity"), {});
});

test("what is written is read again", () => {
  assert.equal(writeMoment("3.5", 1006), "#t=3.5&agent=1006");
  assert.deepEqual(readMoment(writeMoment("0.00", null)), { seconds: 0 });
});
