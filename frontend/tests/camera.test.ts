import assert from "node:assert/strict";
import { test } from "node:test";
import { Camera } from "../src/camera";

function camera(angle = 0): Camera {
  const made = new Camera(angle);
  [made.width, made.height] = [800, 400];
  made.fit(10, 20, 100, 100);
  return made;
}

test("what is fitted lies inside, its middle in the middle, north up", () => {
  const made = camera();
  assert.equal(made.scale, 4);
  assert.deepEqual(made.toScreen(10, 20), [400, 200]);
  assert.deepEqual(made.toScreen(10, 30), [400, 160]);
});

test("a turned map has its direction to the right", () => {
  const [x, y] = camera(Math.PI / 2).toScreen(10, 30);
  assert.ok(Math.abs(x - 440) < 1e-9 && Math.abs(y - 200) < 1e-9);
});

test("zooming keeps the place under the pointer", () => {
  const made = camera(0.3);
  const before = made.toWorld(100, 50);
  made.zoom(2.5, 100, 50);
  const [x, y] = made.toScreen(...before);
  assert.ok(Math.hypot(x - 100, y - 50) < 1e-9);
  assert.equal(made.scale, 10);
});

test("panning moves the map with the pointer", () => {
  const made = camera();
  made.pan(40, -20);
  assert.deepEqual(made.toScreen(10, 20), [440, 180]);
});
