// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { exportAddress, listExports } from '../api/server_api';
import type { GetAccuracyResponse } from '../api/types';
import { Problem, saveFile } from '../shell/parts';
import { useLoaded } from '../shell/use_async';

const names: Record<string, string> = {
  opencv: 'OpenCV YAML', json: 'JSON', kalibr: 'kalibr', ros: 'ROS', colmap: 'COLMAP text', 'colmap-binary': 'COLMAP binary',
  nerfstudio: 'nerfstudio', anipose: 'anipose', pose2sim: 'Pose2Sim', caliscope: 'caliscope', mcap: 'MCAP', openmvg: 'OpenMVG',
  matlab: 'MATLAB', blender: 'Blender', usd: 'USD',
};

/** Every format in which the server exports a calibration, and what only this page has. */
export function Downloads({ id, accuracy }: { id: string; accuracy: GetAccuracyResponse | undefined }): JSX.Element {
  const [undistorted, setUndistorted] = useState(false);
  const [maxErrorPx, setMaxErrorPx] = useState(0);
  const options = { undistorted, maxErrorPx };
  const exports = useLoaded(`exports ${id} ${undistorted} ${maxErrorPx}`, (signal) => listExports(id, options, signal));
  return <>
    <label class="check"><input type="checkbox" checked={undistorted} onChange={(event) => setUndistorted(event.currentTarget.checked)} /> Undistorted:
      for images whose lens distortion is taken out; every camera is a pinhole with the same camera matrix</label>
    <label class="check">Lenses that a format cannot say are written as the nearest one, off by at most
      <select value={maxErrorPx} onChange={(event) => setMaxErrorPx(Number(event.currentTarget.value))}>
        <option value={0}>0.5 px</option>{[2, 10, 50].map((px) => <option key={px} value={px}>{px} px</option>)}</select></label>
    <Problem text={exports.problem} />
    <ul class="exports">
      {(exports.value?.formats ?? []).map((format) => <li key={format.name}>
        {format.problem ? <span class="button off" aria-disabled="true">{names[format.name ?? ''] ?? format.name}</span>
          : <a class="button" href={exportAddress(id, format.name ?? '', options)} download>{names[format.name ?? ''] ?? format.name}</a>}
        <span class="hint">{format.problem ? `▲ ${format.problem}` : format.description}</span></li>)}
      {accuracy && <li><button type="button" onClick={() =>
        saveFile(`${id}-accuracy.json`, 'application/json', `${JSON.stringify(accuracy, null, 2)}\n`)}>Expected errors</button>
        <span class="hint">the grid of this page, as JSON</span></li>}
    </ul>
    <p class="hint">In a terminal: <code>rigcal calibration export {id} --format …{undistorted ? ' --undistorted' : ''}{maxErrorPx > 0 ? ` --max-error-px ${maxErrorPx}` : ''} --output DIR</code>.
      Points in 3-D from rows of the cameras: <code>rigcal triangulate {id} --data DIR --output points.csv</code></p>
  </>;
}
