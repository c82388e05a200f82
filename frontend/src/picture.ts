// The map as a PNG file, with the time and a scale below it.

import { PALETTES } from "./colors";
import type { RoadMap } from "./map";
import type { Run } from "./run";
import type { State } from "./state";

/** Pixels of the picture per pixel of the page: enough for print. */
const RATIO = 3;
/** Height of the line below the map [px of the page]. */
const FOOT = 26;

/** Saves what the map shows now. */
export function savePicture(run: Run, state: State, map: RoadMap): void {
  const layers = map.layers(RATIO);
  const picture = document.createElement("canvas");
  [picture.width, picture.height] = [layers[0].width, layers[0].height + FOOT * RATIO];
  const ctx = picture.getContext("2d")!;
  const colors = PALETTES[state.theme];
  ctx.fillStyle = colors.background;
  ctx.fillRect(0, 0, picture.width, picture.height);
  for (const layer of layers) ctx.drawImage(layer, 0, 0);
  ctx.fillStyle = colors.background;
  ctx.fillRect(0, layers[0].height, picture.width, FOOT * RATIO);
  ctx.setTransform(RATIO, 0, 0, RATIO, 0, layers[0].height);
  const { length, width } = map.bar;
  [ctx.fillStyle, ctx.strokeStyle, ctx.lineWidth] = [colors.ink, colors.ink, 1.5];
  ctx.font = "13px system-ui, sans-serif";
  ctx.textBaseline = "middle";
  ctx.beginPath();
  for (const [x, y] of [
    [10, 9],
    [10, 17],
    [10 + width, 17],
    [10 + width, 9],
  ] as const)
    ctx.lineTo(x, y);
  ctx.stroke();
  const selected = run.header.participants[state.selected];
  const said = `${length} m   ${run.header.name}, ${run.time(state.step)}${selected === undefined ? "" : `, ${selected.kind} ${selected.id}`}`;
  ctx.fillText(said, 20 + width, FOOT / 2);
  picture.toBlob((blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob!);
    const time = ((run.header.first_time_step + state.step) * run.header.dt).toFixed(run.decimals);
    link.download = `${run.header.name.replace(/[^\w.-]+/g, "_")}_${time}s.png`;
    link.click();
    window.setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
  }, "image/png");
}
