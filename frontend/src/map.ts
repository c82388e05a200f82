// The map: two canvases above each other, and what mouse and wheel do on them.

import { Camera } from "./camera";
import { PALETTES } from "./colors";
import { element } from "./elements";
import { Road } from "./road";
import type { Run } from "./run";
import type { State } from "./state";
import { Traffic } from "./traffic";

/** The map shows at most so much of the road when it begins to follow a vehicle [m]. */
const FOLLOWED_WIDTH = 180;

export class RoadMap {
  readonly root = element("div", { class: "map", tabindex: "0", role: "img" });
  readonly camera: Camera;
  private readonly ground = element("canvas", { class: "layer" });
  private readonly moving = element("canvas", { class: "layer" });
  private readonly tip = element("div", { class: "tip", hidden: "" });
  private readonly scaleBar = element("div", { class: "scale" }, element("span"));
  private readonly road: Road;
  private readonly traffic: Traffic;
  private groundKey = "";
  private followed = false;

  constructor(
    private readonly run: Run,
    private readonly state: State,
  ) {
    this.camera = new Camera(run.header.view.angle);
    this.road = new Road(run);
    this.traffic = new Traffic(run);
    this.root.append(this.ground, this.moving, this.scaleBar, this.tip);
    this.root.setAttribute("aria-label", `Map of ${run.header.name}: click on a vehicle to select it`);
    new ResizeObserver(() => this.resize()).observe(this.root);
    this.listen();
  }

  /** Shows where agents move. */
  fit(): void {
    const { width, height } = this.run.header.view;
    this.state.follow = false;
    this.camera.fit(0, 0, width, height);
    this.state.changed();
  }

  zoom(factor: number): void {
    this.camera.zoom(factor);
    this.state.changed();
  }

  /** Moves the map so that a participant is in sight. */
  reveal(row: number): void {
    const pose = this.run.pose(row, this.state.time) ?? this.run.lastPose(row, this.state.time);
    if (pose === undefined || this.camera.shows(pose.x, pose.y)) return;
    this.camera.x = pose.x;
    this.camera.y = pose.y;
  }

  draw(): void {
    const { camera, state } = this;
    const ratio = this.ratio;
    const follows = state.follow && state.selected >= 0;
    // At the beginning of following the map zooms in.
    if (follows && !this.followed) camera.scale = Math.max(camera.scale, camera.width / FOLLOWED_WIDTH);
    this.followed = follows;
    if (follows) {
      const pose = this.run.pose(state.selected, state.time) ?? this.run.lastPose(state.selected, state.time);
      if (pose !== undefined) [camera.x, camera.y] = [pose.x, pose.y];
    }
    const key = [camera.x, camera.y, camera.scale, camera.width, camera.height, ratio, state.theme].join();
    if (key !== this.groundKey) {
      this.groundKey = key;
      this.road.draw(this.ground.getContext("2d")!, camera, ratio, state.theme);
      this.drawScale();
    }
    this.traffic.draw(this.moving.getContext("2d")!, camera, ratio, state);
  }

  /** What it shows now, road and traffic, with so many pixels per pixel of the page. */
  layers(ratio: number): HTMLCanvasElement[] {
    const canvas = () => element("canvas", { width: `${this.camera.width * ratio}`, height: `${this.camera.height * ratio}` });
    const [ground, moving] = [canvas(), canvas()];
    this.road.draw(ground.getContext("2d")!, this.camera, ratio, this.state.theme);
    this.traffic.draw(moving.getContext("2d")!, this.camera, ratio, this.state);
    return [ground, moving];
  }

  /** The scale: a round length [m] and how wide it is on the page [px]. */
  get bar(): { length: number; width: number } {
    const lengths = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000];
    const length = lengths.find((l) => l * this.camera.scale > 60) ?? 5000;
    return { length, width: length * this.camera.scale };
  }

  private get ratio(): number {
    return Math.min(2, window.devicePixelRatio || 1);
  }

  /** Takes the size that the page gives it. */
  resize(): void {
    const { clientWidth, clientHeight } = this.root;
    if (clientWidth === 0 || clientHeight === 0) return;
    const first = this.camera.width <= 1;
    const [width, height] = [Math.round(clientWidth * this.ratio), Math.round(clientHeight * this.ratio)];
    // Setting the size of a canvas clears it, even to the same size.
    if (this.ground.width === width && this.ground.height === height && !first) return;
    for (const canvas of [this.ground, this.moving]) [canvas.width, canvas.height] = [width, height];
    [this.camera.width, this.camera.height] = [clientWidth, clientHeight];
    this.groundKey = "";
    if (first) this.fit();
    else this.state.changed();
    // A browser that takes one picture and leaves may never ask for a frame.
    this.draw();
  }

  private drawScale(): void {
    const { length, width } = this.bar;
    this.scaleBar.style.width = `${width}px`;
    this.scaleBar.style.color = PALETTES[this.state.theme].ink;
    this.scaleBar.firstElementChild!.textContent = `${length} m`;
  }

  private listen(): void {
    let pressed: { x: number; y: number; moved: boolean } | undefined;
    this.root.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      pressed = { x: event.offsetX, y: event.offsetY, moved: false };
      this.root.setPointerCapture(event.pointerId);
    });
    this.root.addEventListener("pointermove", (event) => {
      if (pressed === undefined) {
        this.hover(event.offsetX, event.offsetY);
        return;
      }
      const [dx, dy] = [event.offsetX - pressed.x, event.offsetY - pressed.y];
      if (!pressed.moved && Math.hypot(dx, dy) < 4) return;
      pressed = { x: event.offsetX, y: event.offsetY, moved: true };
      this.state.follow = false;
      this.camera.pan(dx, dy);
      this.state.changed();
    });
    this.root.addEventListener("pointerup", (event) => {
      if (pressed !== undefined && !pressed.moved)
        this.state.select(this.traffic.at(this.camera, this.state, event.offsetX, event.offsetY));
      pressed = undefined;
    });
    this.root.addEventListener("pointerleave", () => (this.tip.hidden = true));
    this.root.addEventListener("dblclick", () => {
      if (this.state.selected >= 0) this.state.follow = true;
      this.state.changed();
    });
    this.root.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        this.camera.zoom(Math.exp(-0.0015 * event.deltaY), event.offsetX, event.offsetY);
        this.state.changed();
      },
      { passive: false },
    );
  }

  private hover(px: number, py: number): void {
    const row = this.traffic.at(this.camera, this.state, px, py);
    this.tip.hidden = row < 0;
    this.root.classList.toggle("over", row >= 0);
    if (row < 0) return;
    const p = this.run.header.participants[row];
    const speed = this.run.pose(row, this.state.time)?.velocity;
    const role = p.agent >= 0 ? (p.planner ?? "agent") : p.name ? `${p.name} of SUMO` : p.static ? "static" : "recorded";
    this.tip.textContent = `${p.id} ${p.kind.replace("_", " ")}, ${role}${speed === undefined ? "" : `, ${speed.toFixed(1)} m/s`}`;
    this.tip.style.transform = `translate(${px + 12}px, ${py + 12}px)`;
  }
}
