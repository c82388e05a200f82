// Values of windows as a line of steps.

type Values = (number | null)[];

/** A round number that is no smaller than any value. */
export function largest(values: Values): number {
  const most = values.reduce<number>((found, value) => Math.max(found, value ?? 0), 0);
  if (!(most > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(most));
  const top = [1, 2, 5, 10].find((factor) => factor * power >= most * (1 - 1e-9)) ?? 10;
  return top * power;
}

/** A path through the values of windows, from the left edge at the first begin to the right one at the last end; windows
 *  without a value are gaps. */
export function outline(edges: number[], values: Values, top: number, [width, height]: [number, number]): string {
  const [begin, end] = [edges[0], edges[edges.length - 1]];
  const x = (time: number) => ((width * (time - begin)) / (end - begin)).toFixed(1);
  let [path, drawing] = ["", false];
  values.forEach((value, i) => {
    if (value === null) {
      drawing = false;
      return;
    }
    const y = (height * (1 - value / top)).toFixed(1);
    path += `${drawing ? "V" : `M${x(edges[i])} `}${y}H${x(edges[i + 1])}`;
    drawing = true;
  });
  return path;
}
