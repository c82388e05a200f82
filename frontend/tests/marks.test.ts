import assert from "node:assert/strict";
import { test } from "node:test";
import { agentColor, costColor } from "../src/colors";
import { AGENTS, MARKS, OUTCOMES } from "../src/contract";
import { text } from "../src/elements";
import { mark } from "../src/marks";

test("every outcome has a shape and a colour of its own", () => {
  const looks = OUTCOMES.map((outcome) => JSON.stringify([mark(outcome).corners, mark(outcome).color]));
  assert.equal(new Set(looks).size, OUTCOMES.length);
  for (const kind of Object.keys(MARKS)) assert.ok(mark(kind).corners.length >= 3, kind);
});

test("agents have other colours on dark ground than on light", () => {
  assert.equal(new Set(AGENTS.map((color) => agentColor(color, "dark"))).size, AGENTS.length);
  for (const color of AGENTS) assert.notEqual(agentColor(color, "dark"), agentColor(color, "light"));
});

test("the cheapest candidate stands out on both grounds", () => {
  assert.equal(costColor(0, "light"), "rgb(68,1,84)");
  assert.equal(costColor(0, "dark"), "rgb(253,231,37)");
  assert.equal(costColor(-3, "light"), costColor(0, "light"));
});

test("zero has no sign, and what is undefined no text", () => {
  assert.equal(text(-0.004, 2), "0.00");
  assert.equal(text(Infinity, 2, "s"), "∞");
  assert.equal(text(1.25, 1, "m/s"), "1.3 m/s");
  assert.equal(text(NaN, 1), "");
});

test("what lies beyond its horizon is told as such", () => {
  assert.equal(text(1469952, 2, "s", 60), "> 60 s");
  assert.equal(text(-1.03e8, 2, "m/s²", 100), "< -100 m/s²");
  assert.equal(text(60, 2, "s", 60), "60.00 s");
  assert.equal(text(75, 2, "s"), "75.00 s");
});
