// SPDX-License-Identifier: Apache-2.0
// The map of a large rig: a dot for each camera. Colour is never alone: an error is a cross, a warning a triangle.
import { placeLabels, scaleBar } from '../scene/plan_layout';
import { palette } from '../shell/palette';
import { type CameraNeed, needsSomething } from './camera_needs';
import type { MapLayout } from './map_layout';

/** So many of those that need something have their names beside them. */
const mostNames = 12;
const labelHeight = 14;

/** Dots hardly cover each other, and are large enough to be seen. */
function dotRadius(layout: MapLayout): number {
  const points = [...layout.at.values()];
  const reach = (k: 0 | 1): number => Math.max(...points.map((p) => p[k])) - Math.min(...points.map((p) => p[k]));
  return points.length < 2 ? 7 : Math.max(2, Math.min(7, 0.3 * Math.sqrt((reach(0) * reach(1)) / points.length)));
}

/** Draws the map; `found`: cameras that the search has left, `chosen`: the one that was tapped. */
export function drawMap(context: CanvasRenderingContext2D, width: number, height: number, layout: MapLayout,
  needs: readonly CameraNeed[], found: ReadonlySet<string>, chosen: string): void {
  const colours = palette();
  const colourOf = { bad: colours.bad, warn: colours.warn, good: colours.good, live: colours.good, info: colours.accent, idle: colours.faint };
  const radius = dotRadius(layout);
  context.save();
  context.lineJoin = 'round';
  // What needs something is drawn last, on top.
  for (const need of [...needs].reverse()) {
    const at = layout.at.get(need.name);
    if (!at) continue;
    const [x, y] = at;
    context.globalAlpha = found.has(need.name) ? 1 : 0.18;
    context.fillStyle = context.strokeStyle = colourOf[need.mark];
    context.lineWidth = Math.max(2, radius / 2);
    context.beginPath();
    const r = radius * 1.3;
    if (need.mark === 'bad') {
      context.moveTo(x - r, y - r);
      context.lineTo(x + r, y + r);
      context.moveTo(x + r, y - r);
      context.lineTo(x - r, y + r);
      context.stroke();
    } else if (need.mark === 'warn') {
      context.moveTo(x, y - r);
      context.lineTo(x + r, y + r);
      context.lineTo(x - r, y + r);
      context.closePath();
      context.fill();
    } else {
      context.arc(x, y, radius, 0, 7);
      context.fill();
    }
  }
  context.globalAlpha = 1;
  const ring = layout.at.get(chosen);
  if (ring) {
    context.strokeStyle = colours.ink;
    context.lineWidth = 2;
    context.beginPath();
    context.arc(...ring, radius * 2.2, 0, 7);
    context.stroke();
  }
  context.font = '600 11px system-ui, sans-serif';
  const named = [...needs.filter((need) => need.name === chosen),
    ...needs.filter((need) => need.name !== chosen && needsSomething(need) && found.has(need.name)).slice(0, mostNames)];
  const bar = layout.pixelsPerMetre === undefined ? undefined : scaleBar(layout.pixelsPerMetre, Math.min(120, width / 3));
  const labels = placeLabels(named.filter((need) => layout.at.has(need.name)).map((need) => ({ text: need.name, at: layout.at.get(need.name)!,
    width: context.measureText(need.name).width + 4 })), [{ x: 0, y: 0, width: 170, height: 18 },
    { x: 0, y: height - 22, width: 180, height: 22 }], width, height, labelHeight);
  context.textBaseline = 'middle';
  context.textAlign = 'left';
  for (const label of labels) {
    context.lineWidth = 3;
    context.strokeStyle = colours.surface;
    context.strokeText(label.text, label.x + 2, label.y + labelHeight / 2);
    context.fillStyle = colours.ink;
    context.fillText(label.text, label.x + 2, label.y + labelHeight / 2);
  }
  context.fillStyle = colours.faint;
  context.fillText(bar ? 'from above' : 'places not known yet: by name', 8, 10);
  if (bar) {
    context.strokeStyle = colours.faint;
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(10, height - 12);
    context.lineTo(10 + bar.px, height - 12);
    context.stroke();
    context.fillText(bar.text, 16 + bar.px, height - 12);
  }
  if (layout.unplaced > 0) {
    context.textAlign = 'right';
    context.fillText(`below: ${layout.unplaced} without a place yet`, width - 8, 10);
  }
  context.restore();
}
