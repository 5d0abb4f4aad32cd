// SPDX-License-Identifier: Apache-2.0
// The rig from above or from the side, without WebGL.
import { palette } from '../shell/palette';
import { errorQuality, qualityRgb, rgbText } from '../view/colour_scale';
import { add, boxOf, type Vec3 } from '../view/geometry';
import { type RigModel, wantedMm } from '../view/rig_model';

/** Which two room axes are drawn: [across, up]. */
export type PlanView = 'top' | 'side';
const axesOf: Record<PlanView, readonly [0 | 1, 1 | 2]> = { top: [0, 1], side: [0, 2] };

/** Worst place of each column of the grid, seen along the third axis. */
export function flattened(model: RigModel, view: PlanView): { at: readonly [number, number]; sigmaMm: number }[] {
  const [across, up] = axesOf[view];
  const step = model.stepM > 0 ? model.stepM : 0.1;
  const worst = new Map<string, { at: readonly [number, number]; sigmaMm: number }>();
  for (const one of model.places) {
    const key = `${Math.round(one.at[across] / step)} ${Math.round(one.at[up] / step)}`;
    const before = worst.get(key);
    if (!before || before.sigmaMm < one.sigmaMm) worst.set(key, { at: [one.at[across], one.at[up]], sigmaMm: one.sigmaMm });
  }
  return [...worst.values()];
}

/** Draws the plan into a box. */
export function drawPlan(context: CanvasRenderingContext2D, width: number, height: number, model: RigModel,
  view: PlanView, targetMm: number | undefined): void {
  const colours = palette();
  const [across, up] = axesOf[view];
  const box = boxOf([...model.cameras.map((camera) => camera.rigFromCam.t), ...model.places.map((one) => one.at),
    ...model.wand]);
  if (!box) return;
  const margin = 34;
  const sizes = [Math.max(0.5, box.max[across] - box.min[across]), Math.max(0.5, box.max[up] - box.min[up])] as const;
  const scale = Math.min((width - 2 * margin) / sizes[0], (height - 2 * margin) / sizes[1]);
  const middle = [(box.min[across] + box.max[across]) / 2, (box.min[up] + box.max[up]) / 2] as const;
  const at = (a: number, b: number): [number, number] =>
    [width / 2 + (a - middle[0]) * scale, height / 2 - (b - middle[1]) * scale];
  const point = (p: Vec3): [number, number] => at(p[across], p[up]);
  const wanted = wantedMm(targetMm, model.places);
  const step = (model.stepM > 0 ? model.stepM : 0.1) * scale;
  for (const one of flattened(model, view)) {
    const quality = errorQuality(one.sigmaMm, wanted);
    const size = Math.max(2, step * (0.35 + 0.55 * (1 - quality)));
    const [x, y] = at(...one.at);
    context.fillStyle = rgbText(qualityRgb(quality), 0.85);
    context.fillRect(x - size / 2, y - size / 2, size, size);
  }
  context.font = '600 11px system-ui, sans-serif';
  context.textAlign = 'center';
  context.lineJoin = 'round';
  for (const camera of model.cameras) {
    const { r, t } = camera.rigFromCam;
    const depth = 18 / scale;
    const corner = (side: number): [number, number] => {
      const p: Vec3 = [side * camera.halfWidth * depth, 0, depth];
      return point(add(t, [r[0][0] * p[0] + r[0][2] * p[2], r[1][0] * p[0] + r[1][2] * p[2], r[2][0] * p[0] + r[2][2] * p[2]]));
    };
    const [x, y] = point(t);
    context.strokeStyle = colours.ink;
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(...corner(-1));
    context.lineTo(...corner(1));
    context.closePath();
    context.stroke();
    context.lineWidth = 3;
    context.strokeStyle = colours.surface;
    const below = y + (y > height / 2 ? 15 : -8);
    const label = Math.min(width - 26, Math.max(26, x));
    context.strokeText(camera.name, label, below);
    context.fillStyle = colours.ink;
    context.fillText(camera.name, label, below);
  }
  if (model.wand.length > 0) {
    context.strokeStyle = colours.ink;
    context.lineWidth = 2;
    context.beginPath();
    model.wand.forEach((p, i) => (i === 0 ? context.moveTo(...point(p)) : context.lineTo(...point(p))));
    context.stroke();
    context.fillStyle = colours.ink;
    for (const p of model.wand) {
      context.beginPath();
      context.arc(...point(p), 3.5, 0, 7);
      context.fill();
    }
  }
  const ring = (p: Vec3, radius: number, colour: string) => {
    context.strokeStyle = colour;
    context.lineWidth = 2;
    context.beginPath();
    context.arc(...point(p), radius, 0, 7);
    context.stroke();
  };
  if (model.worst) ring(model.worst, 7, colours.ink);
  model.advice.forEach((p, i) => ring(p, i === 0 ? 12 : 8, colours.accent));
  context.textAlign = 'left';
  context.fillStyle = colours.faint;
  context.fillText(view === 'top' ? 'from above' : 'from the side', 8, 16);
}
