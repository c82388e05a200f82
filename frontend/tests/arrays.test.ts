import assert from "node:assert/strict";
import { test } from "node:test";
import { inflate, unpack } from "../src/arrays";
import { packed } from "./packed";

test("whole numbers are read from their byte planes, little end first", () => {
  // -2 and 258 as 16-bit integers: low bytes fe 02, high bytes ff 01.
  const found = unpack({ type: "i16", shape: [2], at: 1 }, Uint8Array.of(0, 0xfe, 0x02, 0xff, 0x01));
  assert.deepEqual([...found], [-2, 258]);
});

test("differences add up along rows, and first columns from row to row", () => {
  const found = unpack({ type: "i8", shape: [2, 3], at: 0, steps: true }, Uint8Array.of(10, 1, 1, 5, 0, 0xff));
  assert.deepEqual([...found], [10, 11, 12, 15, 15, 14]);
});

test("multiples of a resolution become numbers, and masked ones are not a number", () => {
  const found = unpack({ type: "u8", shape: [3], at: 0, unit: 0.5, absent: 3 }, Uint8Array.of(2, 0, 7, 0b010));
  assert.deepEqual([...found], [1, NaN, 3.5]);
});

test("floats survive compression", async () => {
  const [entries, text] = packed({ a: { shape: [2], values: [1.5, NaN] } });
  assert.deepEqual([...unpack(entries.a, await inflate(text))], [1.5, NaN]);
});
