import assert from "node:assert/strict";
import { test } from "node:test";
import { largest, outline } from "../src/steps";

test("values of windows are steps, and a window without one is a gap", () => {
  const path = outline([0, 10, 20, 30, 35], [100, 50, null, 0], 100, [70, 40]);
  assert.equal(path, "M0.0 0.0H20.0V20.0H40.0M60.0 40.0H70.0");
});

test("scales end at a round number above all values", () => {
  assert.equal(largest([3, null, 17]), 20);
  assert.equal(largest([720]), 1000);
  assert.equal(largest([500]), 500);
  assert.equal(largest([null, 0]), 1);
  assert.equal(largest([]), 1);
});
