// SPDX-License-Identifier: Apache-2.0
// The rig from above or from the side, without WebGL.
import { palette } from '../shell/palette';
import { errorQuality, qualityRgb, rgbText, wantedMm } from '../view/colour_scale';
import { add, boxOf, type DrawnCamera, type Vec3 } from '../view/geometry';
import type { RigModel } from '../view/rig_model';
import { type LabelBox, mostNamed, placeLabels, scaleBar } from './plan_layout';

/** Which two room axes are drawn: [across, up]. */
export type PlanView = 'top' | 'side';
const axesOf: Record<PlanView, readonly [0 | 1, 1 | 2]> = { top: [0, 1], side: [0, 2] };

/** Sizes on a screen whose text is 16 px high, pixels: room above and below for words and scale, and on each side. */
const usual = { text: 11, label: 14, top: 22, bottom: 30, side: 12, camera: 18, axis: 20 };
type Sizes = typeof usual;

/** The same as large as the text of this screen is. */
function sizesHere(): Sizes {
  const k = (parseFloat(getComputedStyle(document.documentElement).fontSize) || 16) / 16;
  return Object.fromEntries(Object.entries(usual).map(([name, px]) => [name, px * Math.max(1, k)])) as Sizes;
}

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

type Point = readonly [number, number];

/** Where everything is in a box of so many pixels: all of it inside. */
export function planProjection(model: RigModel, view: PlanView, width: number, height: number, margin: Sizes = usual):
  { scale: number; at: (p: Vec3) => Point } | undefined {
  const [across, up] = axesOf[view];
  const half = 0.5 * model.stepM;
  const box = boxOf([...model.cameras.map((camera) => camera.rigFromCam.t),
    ...model.places.flatMap((one): Vec3[] => [add(one.at, [half, half, half]), add(one.at, [-half, -half, -half])]),
    ...model.wand, ...model.advice, ...(model.worst ? [model.worst] : []), ...(model.frameIsSet ? [model.frame.origin] : [])]);
  if (!box) return undefined;
  const sizes = [Math.max(0.5, box.max[across] - box.min[across]), Math.max(0.5, box.max[up] - box.min[up])] as const;
  // Cameras stand at the edge and may look outwards.
  const [w, h] = [width - 2 * (margin.side + margin.camera), height - margin.top - margin.bottom - 2 * margin.camera];
  const scale = Math.max(1e-6, Math.min(w / sizes[0], h / sizes[1]));
  const middle = [(box.min[across] + box.max[across]) / 2, (box.min[up] + box.max[up]) / 2] as const;
  const centre = [width / 2, margin.top + (height - margin.top - margin.bottom) / 2] as const;
  return { scale, at: (p) => [centre[0] + (p[across] - middle[0]) * scale, centre[1] - (p[up] - middle[1]) * scale] };
}

/** The triangle of a camera. */
function cameraCorners(camera: DrawnCamera, at: (p: Vec3) => Point, depth: number): readonly [Point, Point, Point] {
  const { r, t } = camera.rigFromCam;
  // A lens of a very wide angle is drawn as one of a wide angle.
  const half = Math.min(0.8, camera.halfWidth);
  const corner = (side: number): Point => {
    const p: Vec3 = [side * half * depth, 0, depth];
    return at(add(t, [r[0][0] * p[0] + r[0][2] * p[2], r[1][0] * p[0] + r[1][2] * p[2], r[2][0] * p[0] + r[2][2] * p[2]]));
  };
  return [at(t), corner(-1), corner(1)];
}

/** Draws the plan into a box. */
export function drawPlan(context: CanvasRenderingContext2D, width: number, height: number, model: RigModel,
  view: PlanView, goalMm: number | undefined): void {
  const colours = palette();
  const px = sizesHere();
  const projection = planProjection(model, view, width, height, px);
  if (!projection) return;
  const { scale, at } = projection;
  const [across, up] = axesOf[view];
  const flat = (a: number, b: number): Vec3 => (view === 'top' ? [a, b, 0] : [a, 0, b]);
  const wanted = wantedMm(goalMm);
  context.save();
  context.beginPath();
  context.rect(0, 0, width, height);
  context.clip();
  const step = (model.stepM > 0 ? model.stepM : 0.1) * scale;
  for (const one of flattened(model, view)) {
    const quality = errorQuality(one.sigmaMm, wanted);
    const size = Math.max(2, step * (0.35 + 0.55 * (1 - quality)));
    const [x, y] = at(flat(...one.at));
    context.fillStyle = rgbText(qualityRgb(quality), 0.85);
    context.fillRect(x - size / 2, y - size / 2, size, size);
  }
  context.lineJoin = 'round';
  context.strokeStyle = colours.ink;
  context.lineWidth = 1.5;
  const triangles = model.cameras.map((camera) => cameraCorners(camera, at, px.camera / scale));
  for (const [tip, ...corners] of triangles) {
    context.beginPath();
    context.moveTo(...tip);
    for (const corner of corners) context.lineTo(...corner);
    context.closePath();
    context.stroke();
  }
  if (model.wand.length > 0) {
    context.strokeStyle = colours.ink;
    context.lineWidth = 2;
    context.beginPath();
    model.wand.forEach((p, i) => (i === 0 ? context.moveTo(...at(p)) : context.lineTo(...at(p))));
    context.stroke();
    context.fillStyle = colours.ink;
    for (const p of model.wand) {
      context.beginPath();
      context.arc(...at(p), 3.5, 0, 7);
      context.fill();
    }
  }
  const ring = (p: Vec3, radius: number, colour: string) => {
    context.strokeStyle = colour;
    context.lineWidth = 2;
    context.beginPath();
    context.arc(...at(p), radius, 0, 7);
    context.stroke();
  };
  if (model.worst) ring(model.worst, 7, colours.ink);
  model.advice.forEach((p, i) => ring(p, i === 0 ? 12 : 8, colours.accent));

  context.font = `600 ${px.text}px system-ui, sans-serif`;
  const bar = scaleBar(scale, Math.min(7 * px.camera, width / 3));
  const axesAt: Point = model.frameIsSet ? at(model.frame.origin) : [width - 2 * px.axis, height - 1.8 * px.axis];
  const reach = 1.5 * px.axis;
  const taken: LabelBox[] = [
    { x: 0, y: 0, width: 8 * px.label, height: px.top - 2 }, { x: 0, y: height - px.bottom, width: bar.px + 4 * px.label, height: px.bottom },
    { x: axesAt[0] - reach, y: axesAt[1] - reach, width: 2 * reach, height: 2 * reach },
    ...triangles.map((corners): LabelBox => {
      const [xs, ys] = [corners.map(([x]) => x), corners.map(([, y]) => y)];
      const [x, y] = [Math.min(...xs), Math.min(...ys)];
      return { x, y, width: Math.max(...xs) - x, height: Math.max(...ys) - y };
    })];
  const labels = placeLabels((model.cameras.length > mostNamed ? [] : model.cameras).map((camera) => ({ text: camera.name, at: at(camera.rigFromCam.t),
    width: context.measureText(camera.name).width + 4 })), taken, width, height, px.label);
  context.textBaseline = 'middle';
  context.textAlign = 'left';
  for (const label of labels) {
    if (label.far) {
      context.strokeStyle = colours.faint;
      context.lineWidth = 1;
      context.beginPath();
      context.moveTo(...label.at);
      context.lineTo(Math.min(label.x + label.width, Math.max(label.x, label.at[0])), label.y + px.label / 2);
      context.stroke();
    }
    context.lineWidth = 3;
    context.strokeStyle = colours.surface;
    context.strokeText(label.text, label.x + 2, label.y + px.label / 2);
    context.fillStyle = colours.ink;
    context.fillText(label.text, label.x + 2, label.y + px.label / 2);
  }

  // The axes of the rig frame: at its origin where somebody has set it, else in the corner.
  for (const [k, name] of (['x', 'y', 'z'] as const).entries()) {
    const axis = model.frame.axes[k]!;
    const [dx, dy] = [axis[across] * px.axis, -axis[up] * px.axis];
    if (Math.hypot(dx, dy) < 0.3 * px.axis) continue;
    context.strokeStyle = colours.faint;
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(...axesAt);
    context.lineTo(axesAt[0] + dx, axesAt[1] + dy);
    context.stroke();
    context.fillStyle = colours.ink;
    context.textAlign = 'center';
    context.fillText(name, axesAt[0] + dx * 1.35, axesAt[1] + dy * 1.35);
  }
  context.strokeStyle = colours.faint;
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(10, height - 16);
  context.lineTo(10, height - 10);
  context.lineTo(10 + bar.px, height - 10);
  context.lineTo(10 + bar.px, height - 16);
  context.stroke();
  context.textAlign = 'left';
  context.fillStyle = colours.ink;
  context.fillText(bar.text, 16 + bar.px, height - 13);
  context.fillStyle = colours.faint;
  context.fillText(view === 'top' ? 'from above' : 'from the side', 8, px.top / 2);
  context.restore();
}
