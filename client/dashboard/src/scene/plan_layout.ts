// SPDX-License-Identifier: Apache-2.0
// Names in a plan that do not cover each other, and a bar for its scale.

/** So many cameras have their names in a picture of the rig: of more no name could be read. */
export const mostNamed = 64;

/** A box, pixels from the top left. */
export interface LabelBox {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** A name at its place. */
export interface PlacedLabel extends LabelBox {
  text: string;
  /** What it names. */
  at: readonly [number, number];
  /** So far from it that a line is needed. */
  far: boolean;
}

const apart = (a: LabelBox, b: LabelBox): boolean =>
  a.x + a.width <= b.x || b.x + b.width <= a.x || a.y + a.height <= b.y || b.y + b.height <= a.y;

/** Places each name as near as possible to what it names: inside of the picture, on no other name and on nothing that
 * is `taken`. A name for which there is no room is left out. */
export function placeLabels(labels: readonly { text: string; at: readonly [number, number]; width: number }[],
  taken: readonly LabelBox[], width: number, height: number, labelHeight: number): PlacedLabel[] {
  const placed: PlacedLabel[] = [];
  for (const { text, at, width: w } of labels) {
    const near = 0.65 * labelHeight + labelHeight / 2;
    for (let ring = 0; ring < 6; ++ring) {
      const away = near + ring * 0.8 * labelHeight;
      const found = [-90, 90, -45, 45, -135, 135, 0, 180, -65, 65, -115, 115].map((degrees): PlacedLabel => {
        const [c, s] = [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180)];
        return { text, at, width: w, height: labelHeight, far: ring > 1,
          x: at[0] + away * c + (c > 0.3 ? 0 : c < -0.3 ? -w : -w / 2), y: at[1] + away * s - labelHeight / 2 };
      }).find((box) => box.x >= 2 && box.y >= 2 && box.x + box.width <= width - 2 && box.y + box.height <= height - 2 &&
        taken.every((other) => apart(box, other)) && placed.every((other) => apart(box, other)));
      if (!found) continue;
      placed.push(found);
      break;
    }
  }
  return placed;
}

/** A bar of 1, 2 or 5 times a power of ten metres, as long as fits into so many pixels. */
export function scaleBar(pixelsPerMetre: number, mostPx: number): { px: number; text: string } {
  const most = mostPx / Math.max(1e-9, pixelsPerMetre);
  const decade = 10 ** Math.floor(Math.log10(most));
  const metres = decade * ([5, 2].find((step) => step * decade <= most * 1.0001) ?? 1);
  return { px: metres * pixelsPerMetre, text: `${Number(metres.toPrecision(1))} m` };
}
