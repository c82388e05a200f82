// Bundles the front end into python/interdrive/report/bundle; the first line names the sources it was made from.

import { createHash } from "node:crypto";
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const folder = new URL("../python/interdrive/report/bundle/", import.meta.url);

/**
 * SHA-256 over names and contents of all sources; tests/report/test_report.py computes it again.
 * Not of the lock file: what it locks of other platforms differs from npm to npm; package.json names exact versions.
 */
function fingerprint() {
  const names = [...readdirSync("src").map((name) => `src/${name}`), "build.mjs", "package.json"];
  const total = createHash("sha256");
  for (const name of names.sort()) total.update(`${name}\n`).update(readFileSync(name));
  return total.digest("hex");
}

const made = await build({
  entryPoints: ["src/main.ts"],
  bundle: true,
  minify: true,
  format: "iife",
  target: ["chrome103", "firefox113", "safari16.4"],
  charset: "utf8",
  legalComments: "none",
  outdir: "bundle",
  write: false,
});
const notice = `/* interdrive report, sources ${fingerprint()}; uPlot (MIT), see LICENSES.txt */\n`;
for (const file of made.outputFiles) {
  const name = file.path.endsWith(".css") ? "report.css" : "report.js";
  if (file.text.includes("</script") || file.text.includes("</style")) throw new Error(`${name} would end its element`);
  writeFileSync(new URL(name, folder), notice + file.text);
}
const license = readFileSync("node_modules/uplot/LICENSE", "utf8").trim();
writeFileSync(
  new URL("LICENSES.txt", folder),
  `report.js and report.css are built from frontend/ (BSD 3-Clause, as interdrive) and contain\nuPlot ${JSON.parse(readFileSync("node_modules/uplot/package.json", "utf8")).version}, https://github.com/leeoniya/uPlot:\n\n${license}\n`,
);
