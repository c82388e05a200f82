// The page of a batch: comparison, differences, distributions, and a list of runs with links to their pages.

import { inflate, unpack } from "./arrays";
import type { Theme } from "./colors";
import { differences, planners } from "./comparison";
import type { BatchHeader, Part } from "./contract";
import { Distributions } from "./distributions";
import { button, element } from "./elements";
import { RunList } from "./runs";

export async function showBatch(root: HTMLElement, header: BatchHeader, arrays: string): Promise<void> {
  const bytes = await inflate(arrays);
  const tables = Object.fromEntries(Object.entries(header.arrays).map(([n, e]) => [n, unpack(e, bytes)]));
  let theme: Theme = window.matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
  let zoom = 1;
  root.classList.add("batch");

  const compared = element("div");
  const list = new RunList(header);
  const distributions = new Distributions(header, tables);
  const choice = element("select", { "aria-label": "Traffic, agents and category" });
  const options = header.compared;
  let group = element("optgroup");
  options.forEach(({ category, title }, i) => {
    // All categories come first in their set.
    if (category === "all") {
      group = element("optgroup", { label: title });
      choice.append(group);
    }
    group.append(element("option", { value: String(i) }, category === "all" ? "all categories" : category));
  });
  const show = () => {
    document.documentElement.dataset.theme = theme;
    document.documentElement.style.setProperty("--zoom", String(zoom));
    const option = options[Number(choice.value)] ?? options[0];
    const inside = (part: Part) =>
      part.traffic === option.traffic && part.agents === option.agents && (option.category === "all" || part.category === option.category);
    const said = element("section", {}, element("h2", {}, option.title), element("p", { class: "hint" }, option.size));
    compared.replaceChildren(said, planners(option), differences(option));
    list.restrict(inside);
    distributions.draw(inside, theme, zoom);
    root.dataset.ready = "true";
  };
  choice.addEventListener("change", show);
  const finished = header.runs.filter((run) => run.status === "finished").length;
  const head = element(
    "header",
    { class: "head" },
    element("h1", {}, header.name),
    element("span", { class: "said" }, `${header.runs.length} runs, ${finished} finished, interdrive ${header.version.join(", ")}`),
    element("span", { class: "space" }),
    choice,
    button("A+", "Larger text (Shift+A)", () => {
      zoom = zoom >= 1.5 ? 1 : zoom + 0.25;
      show();
    }),
    button("◐", "Light or dark (T)", () => {
      theme = theme === "light" ? "dark" : "light";
      show();
    }),
  );
  document.addEventListener("keydown", (event) => {
    if (event.target instanceof HTMLInputElement || event.ctrlKey || event.metaKey) return;
    if (event.key === "t" || event.key === "A") head.querySelectorAll("button")[event.key === "A" ? 0 : 1].click();
  });
  const notes = [...header.missing.map((m) => m.text), ...header.caveats];
  const main = element("main", {}, compared, element("h2", {}, "Distributions over agents"), distributions.root);
  if (notes.length)
    main.append(element("h2", {}, "What the numbers do not prove"), element("ul", {}, ...notes.map((n) => element("li", {}, n))));
  main.append(element("h2", {}, "Runs"), list.root);
  root.replaceChildren(head, main);
  show();
  new ResizeObserver(() => distributions.resize()).observe(main);
}
