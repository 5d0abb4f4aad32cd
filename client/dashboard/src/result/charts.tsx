// SPDX-License-Identifier: Apache-2.0
// Figures of a calibration as drawings. Each has its numbers beside it.
import type { JSX } from 'preact';
import type { CalibratedCamera } from '../api/types';
import { FirstOf } from '../cameras/camera_list';
import { fewCameras } from '../cameras/camera_needs';
import { fixed, inMs } from '../view/format';

const largest = (values: readonly number[]): number => Math.max(1e-9, ...values.filter(Number.isFinite));

/** Reprojection errors by camera: median to 95th percentile as a bar, RMS as a tick; what was solved
 * and what was held out. */
export function ResidualChart({ cameras }: { cameras: readonly CalibratedCamera[] }): JSX.Element {
  const scale = largest(cameras.flatMap((camera) => [camera.residuals?.inlier?.p95_px ?? 0, camera.held_out?.p95_px ?? 0,
    camera.leave_one_out?.p95_px ?? 0])) * 1.05;
  const at = (px: number | undefined) => `${(100 * (px ?? 0)) / scale}%`;
  const wide = (from: number | undefined, to: number | undefined) => `${Math.max(0.4, (100 * ((to ?? 0) - (from ?? 0))) / scale)}%`;
  return <figure class="chart">
    <figcaption>Reprojection error, px: from median to 95th percentile; the tick is the RMS. To {fixed(scale, 1)} px.</figcaption>
    <p class="legend"><span><i class="key solved" />solved</span><span><i class="key heldout" />held out</span>
      <span><i class="key left" />from the other cameras</span></p>
    <FirstOf items={cameras} step={fewCameras}>{(first) => first.map((camera) => <div class="bars" key={camera.camera}>
      <span class="name">{camera.camera}</span>
      <svg width="100%" height="30" role="img" aria-label={`${camera.camera}: RMS ${fixed(camera.residuals?.inlier?.rms_px, 2)} px solved, ${fixed(camera.held_out?.rms_px, 2)} px held out`}>
        {([['solved', camera.residuals?.inlier], ['heldout', camera.held_out], ['left', camera.leave_one_out]] as const)
          .map(([kind, figures], i) => figures?.marker_count ? <g key={kind} class={kind}>
            <rect x={at(figures.median_px)} y={3 + i * 9} width={wide(figures.median_px, figures.p95_px)} height={6} rx={1} />
            <rect class="tick" x={at(figures.rms_px)} y={1.5 + i * 9} width={2} height={9} /></g> : null)}
      </svg></div>)}</FirstOf>
  </figure>;
}

/** Time offsets with three sigmas. */
export function TimeOffsetChart({ cameras }: { cameras: readonly CalibratedCamera[] }): JSX.Element {
  const reach = largest(cameras.map((camera) => Math.abs(camera.time_offset_s ?? 0) +
    3 * (camera.uncertainty?.time_offset_sigma_s ?? 0))) * 1.1;
  const at = (s: number) => `${50 + (50 * s) / reach}%`;
  return <figure class="chart">
    <figcaption>Time offset to the median clock, with three sigmas; from −{inMs(reach, 1)} to {inMs(reach, 1)} ms.</figcaption>
    <FirstOf items={cameras} step={fewCameras}>{(first) => first.map((camera) => {
      const offset = camera.time_offset_s ?? 0;
      const sigma = camera.uncertainty?.time_offset_sigma_s ?? 0;
      return <div class="bars" key={camera.camera}>
        <span class="name">{camera.camera}</span>
        <svg width="100%" height="18" role="img" aria-label={`${camera.camera}: ${inMs(offset)} ms, one sigma ${inMs(sigma)} ms`}>
          <line class="zero" x1="50%" x2="50%" y1="0" y2="18" />
          <line class="sigma" x1={at(offset - 3 * sigma)} x2={at(offset + 3 * sigma)} y1="9" y2="9" />
          <circle class={camera.time_offset_estimated ? 'dot' : 'dot open'} cx={at(offset)} cy="9" r="4" />
        </svg>
        <span class="value">{sigma > 0 ? `${inMs(offset)} ± ${inMs(sigma)}` : inMs(offset)} ms</span></div>;
    })}</FirstOf>
  </figure>;
}
