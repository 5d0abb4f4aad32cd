// SPDX-License-Identifier: Apache-2.0
// Residuals camera by camera: vectors over the image, and the histogram of their lengths.
import type { JSX } from 'preact';
import { useMemo } from 'preact/hooks';
import { getResiduals } from '../api/server_api';
import type { CameraResiduals } from '../api/types';
import { FirstOf } from '../cameras/camera_list';
import { fewCameras } from '../cameras/camera_needs';
import { Canvas } from '../shell/canvas';
import { useLoaded } from '../shell/use_async';
import { memo } from '../wave/memo';
import { count, fixed } from '../view/format';
import { drawResiduals, enlargement, residualQuantile } from './draw_residuals';

const sum = (values: readonly number[] | undefined): number => (values ?? []).reduce((total, value) => total + value, 0);

function Histogram({ residuals }: { residuals: CameraResiduals }): JSX.Element {
  const used = residuals.inlier_counts ?? [];
  const out = residuals.outlier_counts ?? [];
  const most = Math.max(1, ...used.map((value, i) => value + (out[i] ?? 0)));
  const high = 40;
  // What is there can be seen, however rare.
  const tall = (value: number) => (value > 0 ? Math.max(1.2, (high * value) / most) : 0);
  return <svg class="histogram" viewBox={`0 0 ${Math.max(1, used.length)} ${high + 1}`} preserveAspectRatio="none" role="img"
    aria-label={`${residuals.camera}: ${count(sum(used))} markers used, half of them within ${fixed(residualQuantile(residuals, 0.5), 2)} pixels; ${count(sum(out))} left out`}>
    {used.map((value, i) => {
      const [a, b] = [tall(value), tall(out[i] ?? 0)];
      return <g key={i}>
        {a > 0 && <rect class="used" x={i + 0.08} y={high - a} width={0.84} height={a} />}
        {b > 0 && <rect class="out" x={i + 0.08} y={high - a - b} width={0.84} height={b} />}
      </g>;
    })}
    <rect class="ground" x={0} y={high} width={Math.max(1, used.length)} height={1} />
  </svg>;
}

const CameraPlot = memo(function CameraPlot({ residuals, enlarged, theme }: {
  residuals: CameraResiduals; enlarged: number; theme: string;
}): JSX.Element {
  const draw = useMemo(() => drawResiduals(residuals, enlarged), [residuals, enlarged, theme]);
  const bins = residuals.inlier_counts?.length ?? 0;
  const out = sum(residuals.outlier_counts);
  return <li class="plot">
    <div class="head"><h3>{residuals.camera}</h3><span class="hint">{count(sum(residuals.inlier_counts))} used{out > 0 ? `, ✕ ${count(out)} left out` : ''}</span></div>
    <Canvas draw={draw} label={`Residual vectors of ${residuals.camera} over its image`} />
    <Histogram residuals={residuals} />
    <p class="axis"><span>0</span><span>median {fixed(residualQuantile(residuals, 0.5), 2)} px</span>
      <span>{fixed((residuals.bin_px ?? 0) * bins, 2)} px and more</span></p>
  </li>;
});

/** Vectors and histograms of a calibration. `order`: of these cameras, in this order; without it, of all. */
export function ResidualVectors({ id, theme, order }: { id: string; theme: string; order?: readonly string[] | undefined }): JSX.Element {
  const loaded = useLoaded(`residuals ${id}`, (signal) => getResiduals(id, signal));
  const cameras = loaded.value?.cameras ?? [];
  const enlarged = useMemo(() => enlargement(cameras), [loaded.value]);
  const listed = useMemo(() => {
    if (order === undefined) return cameras;
    const byName = new Map(cameras.map((camera) => [camera.camera, camera]));
    return order.flatMap((name) => byName.get(name) ?? []);
  }, [loaded.value, order?.join(' ')]);
  if (loaded.problem !== '') return <p class="hint">No vectors: {loaded.problem}</p>;
  if (cameras.length === 0) return <p class="hint">Loading the vectors …</p>;
  return <>
    <p class="legend"><span><i class="key vector" />projected minus measured, {enlarged}× enlarged</span>
      <span><b class="cross" aria-hidden="true">✕</b>left out as outlier</span><span>below: how many, by length</span></p>
    <FirstOf items={listed} step={fewCameras}>{(first) => <ul class="plots">{first.map((camera) => <CameraPlot key={camera.camera} residuals={camera} enlarged={enlarged} theme={theme} />)}</ul>}</FirstOf>
  </>;
}
