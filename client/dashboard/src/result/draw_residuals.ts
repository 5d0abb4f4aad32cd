// SPDX-License-Identifier: Apache-2.0
// Residual vectors on a camera's image: projected minus measured, enlarged.
import type { CameraResiduals } from '../api/types';
import type { Draw } from '../shell/canvas';
import { palette } from '../shell/palette';

/** Share of the image's width that the 95th percentile of the worst camera is drawn with. */
const shareOfWidth = 0.05;
/** What is longer is cut off here, so that one outlier does not cover the rest. */
const mostOfWidth = 0.14;

/** Length of a used vector below which the given share of them is, pixels; 0: there are none. */
export function residualQuantile(residuals: CameraResiduals, share: number): number {
  const lengths = (residuals.dx_px ?? []).map((dx, i) => Math.hypot(dx, residuals.dy_px?.[i] ?? 0))
    .filter((_length, i) => !residuals.outlier?.[i]).sort((a, b) => a - b);
  return lengths.length === 0 ? 0 : lengths[Math.min(lengths.length - 1, Math.floor(share * lengths.length))]!;
}

/** One enlargement for all cameras, so that they can be compared: 1, 2 or 5 times a power of ten. */
export function enlargement(cameras: readonly CameraResiduals[]): number {
  const wanted = Math.min(...cameras.map((camera) => {
    const p95 = residualQuantile(camera, 0.95);
    return p95 > 0 ? (shareOfWidth * (camera.image_size_px?.width ?? 1000)) / p95 : Infinity;
  }));
  if (!Number.isFinite(wanted) || wanted <= 1) return 1;
  const power = 10 ** Math.floor(Math.log10(wanted));
  return power * ([5, 2].find((step) => step * power <= wanted) ?? 1);
}

/** Draws the vectors of a camera; markers that were left out get a cross. */
export function drawResiduals(residuals: CameraResiduals, enlarged: number): Draw {
  return (context, width, height) => {
    const colours = palette();
    const [imageWidth, imageHeight] = [residuals.image_size_px?.width || 1, residuals.image_size_px?.height || 1];
    const scale = Math.min(width / imageWidth, height / imageHeight);
    const [left, top] = [(width - imageWidth * scale) / 2, (height - imageHeight * scale) / 2];
    context.fillStyle = colours.surface;
    context.fillRect(left, top, imageWidth * scale, imageHeight * scale);
    context.strokeStyle = colours.line;
    context.lineWidth = 1;
    context.strokeRect(left + 0.5, top + 0.5, imageWidth * scale - 1, imageHeight * scale - 1);
    context.save();
    context.beginPath();
    context.rect(left, top, imageWidth * scale, imageHeight * scale);
    context.clip();
    const most = mostOfWidth * imageWidth;
    // What counts is on top.
    for (const outlier of [true, false]) {
      context.strokeStyle = outlier ? colours.bad : colours.accent;
      context.lineWidth = 1;
      // What was left out is a hint, not the picture.
      context.globalAlpha = outlier ? 0.28 : 1;
      context.beginPath();
      (residuals.x_px ?? []).forEach((x, i) => {
        if (Boolean(residuals.outlier?.[i]) !== outlier) return;
        const [dx, dy] = [(residuals.dx_px?.[i] ?? 0) * enlarged, (residuals.dy_px?.[i] ?? 0) * enlarged];
        const cut = Math.min(1, most / Math.max(1e-9, Math.hypot(dx, dy))) * scale;
        // The centre of the first pixel is (0, 0).
        const [px, py] = [left + (x + 0.5) * scale, top + ((residuals.y_px?.[i] ?? 0) + 0.5) * scale];
        context.moveTo(px, py);
        context.lineTo(px + dx * cut, py + dy * cut);
        if (!outlier) return;
        context.moveTo(px - 3, py - 3);
        context.lineTo(px + 3, py + 3);
        context.moveTo(px - 3, py + 3);
        context.lineTo(px + 3, py - 3);
      });
      context.stroke();
    }
    context.restore();
  };
}
