// Small pieces of HTML.

type Attributes = Record<string, string>;

export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

export function button(label: string, title: string, onClick: () => void, attributes: Attributes = {}): HTMLButtonElement {
  const made = element("button", { type: "button", title, "aria-label": title, ...attributes }, label);
  made.addEventListener("click", onClick);
  return made;
}

export function toggle(label: string, title: string, on: boolean, onChange: (on: boolean) => void): HTMLLabelElement {
  const box = element("input", { type: "checkbox" });
  box.checked = on;
  box.addEventListener("change", () => onChange(box.checked));
  return element("label", { class: "toggle", title }, box, label);
}

/** Attributes of cells that hold numbers. */
export const NUMBER = { class: "number" };

/** Removes the columns of a table in which every cell of the body is empty. */
export function dropEmptyColumns(table: HTMLTableElement): HTMLTableElement {
  const body = [...table.tBodies].flatMap((part) => [...part.rows]);
  const isEmpty = (cell: HTMLTableCellElement | undefined) => !cell || (!cell.textContent?.trim() && !cell.childElementCount);
  for (let at = (table.tHead?.rows[0]?.cells.length ?? 0) - 1; body.length && at >= 0; at--)
    if (body.every((row) => isEmpty(row.cells[at]))) for (const row of table.rows) row.deleteCell(at);
  return table;
}

/** A number for people; of sizes beyond the horizon only that they are. */
export function text(value: number | null | undefined, digits: number, unit = "", horizon = Infinity): string {
  if (value === null || value === undefined || Number.isNaN(value)) return "";
  if (!Number.isFinite(value)) return "∞";
  const side = value < 0 ? "< -" : "> ";
  const shown = Math.abs(value) > horizon ? `${side}${horizon}` : value.toFixed(digits);
  return `${Number(shown) === 0 ? shown.replace("-", "") : shown}${unit ? ` ${unit}` : ""}`;
}
