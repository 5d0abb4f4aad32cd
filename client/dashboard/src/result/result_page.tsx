// SPDX-License-Identifier: Apache-2.0
import type { ComponentChildren, JSX } from 'preact';
import { useEffect, useMemo, useState } from 'preact/hooks';
import { durationSeconds, timeMs } from '../api/json_values';
import { cancelCalibration, getAccuracy, getCalibration, listCalibrations, listRigs } from '../api/server_api';
import type { CalibratedCamera, Calibration, Finding } from '../api/types';
import { FirstOf, SearchField } from '../cameras/camera_list';
import { fewCameras } from '../cameras/camera_needs';
import { SceneView } from '../scene/scene_view';
import { Chip, Fact, type Mark, Meter, Panel, Problem, WorkButton } from '../shell/parts';
import { hashOf, type Route } from '../shell/route';
import { useLoaded } from '../shell/use_async';
import { count, dateTime, enumWords, fixed, inMs, millimetres, missing, percent, scaleText, span } from '../view/format';
import { modelOfCalibration } from '../view/rig_model';
import { otherTargetText } from '../view/target_text';
import { Activate, ActiveHistory } from './activate';
import { ResidualChart, TimeOffsetChart } from './charts';
import { compareCalibrations } from './compare';
import { Downloads } from './downloads';
import { frameName, FramePanel } from './frame_panel';
import { goalOf } from './goal';
import { calibrationMark, gradeOf, hasEnded } from './grade';
import { ResidualVectors } from './residual_panel';
import { named, worstFirst } from './worst_first';

/** A calibration with all that is known of its quality; without an id the newest of the rig. */
export function ResultPage({ route, theme }: { route: Route; theme: string }): JSX.Element {
  const list = useLoaded('calibrations', (signal) => listCalibrations({ page_size: 200 }, signal), 10000);
  const all = list.value?.calibrations ?? [];
  const id = route.id || all.find((one) => one.state === 'STATE_SUCCEEDED')?.id || all[0]?.id || '';
  const [turn, setTurn] = useState(0);
  const rigs = useLoaded(`active ${turn}`, (signal) => listRigs(signal), 10000);
  const active = new Set((rigs.value?.rigs ?? []).map((one) => one.active_calibration_id).filter(Boolean));
  return <div class="result">
    <div class="bar">
      <label>Calibration <select value={id} onChange={(event) => { location.hash = hashOf('result', event.currentTarget.value); }}>
        {!all.some((one) => one.id === id) && <option value={id}>{id || 'none yet'}</option>}
        {all.map((one) => <option key={one.id} value={one.id}>
          {one.id} · {one.rig} v{one.version} · {calibrationMark(one)[1]}{active.has(one.id) ? ' · active' : ''} · {dateTime(timeMs(one.run?.create_time))}</option>)}
      </select></label>
    </div>
    <Problem text={list.problem} />
    {id !== '' ? <Result key={id} id={id} others={all} withId={route.parameters.get('with') ?? ''} theme={theme} onEnd={list.reload}
      turn={turn} onActive={() => setTurn((now) => now + 1)} />
      : !list.loading && <p class="empty">There is no calibration yet. <a href={hashOf('wave')}>Capture a session</a>, then calibrate.</p>}
  </div>;
}

interface Actives {
  /** Grows when another calibration has become active. */
  turn: number;
  onActive: () => void;
}

function Result({ id, others, withId, theme, onEnd, ...actives }: {
  id: string; others: readonly Calibration[]; withId: string; theme: string; onEnd: () => void;
} & Actives): JSX.Element {
  const [ended, setEnded] = useState(false);
  const loaded = useLoaded(id, (signal) => getCalibration(id, signal), ended ? 0 : 700);
  const calibration = loaded.value;
  const state = calibration?.state;
  useEffect(() => {
    if (!hasEnded(state)) return;
    setEnded(true);
    // The list still says that it runs.
    if (others.some((one) => one.id === id && one.state !== state)) onEnd();
  }, [state]);
  if (!calibration) return <>{loaded.loading && <p class="empty">Loading {id} …</p>}<Problem text={loaded.problem} /></>;
  if (state === 'STATE_QUEUED' || state === 'STATE_RUNNING') {
    const progress = calibration.progress;
    return <Panel name="running" title={`${id} is being solved`}>
      <p aria-live="polite">{state === 'STATE_QUEUED' ? 'It waits for the worker.' : `Stage: ${enumWords(progress?.stage, 'CALIBRATION_STAGE_')}`}</p>
      <Meter share={progress?.fraction ?? 0} label="Progress of this stage" />
      {progress?.not_responding && <p class="hint" role="status">Not responding. The server ends it if it stays so.</p>}
      {progress?.solved_by && <p class="hint">Solved by {progress.solved_by}.</p>}
      {progress?.waiting && <p class="problem" role="status">It waits: {progress.waiting}.</p>}
      <WorkButton kind="quiet" work={() => cancelCalibration(id)}>Cancel</WorkButton>
    </Panel>;
  }
  if (state === 'STATE_CANCELLED') {
    return <Panel name="cancelled" title={`${id} was cancelled`}>
      <p>Sessions: {(calibration.session_ids ?? []).join(', ')}</p></Panel>;
  }
  if (state === 'STATE_FAILED') {
    return <Panel name="failed" title={`${id} failed`}>
      <p class="problem"><span aria-hidden="true">✕</span> {calibration.error}</p>
      <p>Sessions: {(calibration.session_ids ?? []).join(', ')}</p></Panel>;
  }
  return <Succeeded calibration={calibration} others={others} withId={withId} theme={theme} {...actives} />;
}

function Succeeded({ calibration, others, withId, theme, turn, onActive }: {
  calibration: Calibration; others: readonly Calibration[]; withId: string; theme: string;
} & Actives): JSX.Element {
  const id = calibration.id ?? '';
  const accuracy = useLoaded(`accuracy ${id}`, (signal) => getAccuracy(id, signal));
  const model = useMemo(() => modelOfCalibration(calibration, accuracy.value), [calibration, accuracy.value]);
  const cameras = calibration.cameras ?? [];
  const many = cameras.length > fewCameras;
  const [text, setText] = useState('');
  const shown = useMemo(() => (many ? named(worstFirst(cameras, calibration.findings ?? []), (one) => one.camera ?? '', text) : cameras),
    [calibration, text]);
  const [mark, words] = gradeOf(calibration);
  const goal = useLoaded(`goal of ${id}`, (signal) => goalOf(calibration, signal));
  const shape = accuracy.value?.shape;
  // Calibrations of older releases have no headline.
  const errorM = calibration.headline?.point_error_m ?? accuracy.value?.calibration_p95_m ?? 0;
  const boundM = calibration.headline?.point_error_bound_m ?? 0;
  const unit = calibration.scale_known ? 'mm' : 'of an unknown scale';
  return <>
    <Panel name="summary" title={`${id}, version ${calibration.version ?? 0} of ${calibration.rig ?? ''}`}
      aside={<span class="grade"><Chip mark={mark}>{words}</Chip></span>}>
      {(calibration.quality?.reasons ?? []).length > 0 && <ul class={`reasons ${mark}`}>{calibration.quality?.reasons?.map((reason) => <li key={reason}>{reason}</li>)}</ul>}
      {!calibration.scale_known && <p class="why">The scale is not known: lengths are in units of the distance between {calibration.reference_camera} and {calibration.unit_camera}.</p>}
      <dl class="facts">
        <Fact name="expected error" title="Of a point by the calibration alone, after the best alignment and at the right scale: this or less in 95 % of the waved places. The figure of the Wave page. The scale comes on top.">
          {errorM > 0 ? `${mark === 'bad' ? 'at least ' : ''}${millimetres(errorM * 1e3)} mm` : missing}</Fact>
        {boundM > 0 && mark !== 'bad' && <Fact name="at most" title="What the expected error is below with a probability of 95 %">
          {millimetres(boundM * 1e3)} mm</Fact>}
        <Fact name="scale" title="On top of the expected error: the scale is as good as the wand was measured">
          {scaleText(calibration.target?.scale_sigma_rel)}</Fact>
        <Fact name="reprojection error" title="Mean of the markers that were used">
          {calibration.headline?.used_mean_px ? `${fixed(calibration.headline.used_mean_px, 3)} px` : missing}</Fact>
        <Fact name="views not used">{calibration.headline ? percent(calibration.headline.unused_share ?? 0, 1) : missing}</Fact>
      </dl>
      <dl class="facts more">
        <Fact name="one point with its noise, 1σ" title="What triangulate will state: with the noise of the centres, relative to the reference camera, without the uncertainty of the scale; in 95 % of the waved volume">
          {shape?.count ? `${millimetres((shape.p95_m ?? 0) * 1e3)} mm` : missing}</Fact>
        <Fact name="length error RMS">{calibration.target?.length_error_rms_m ? `${millimetres(calibration.target.length_error_rms_m * 1e3)} ${unit}` : missing}</Fact>
        <Fact name="instants">{count(calibration.instant_count)}</Fact>
        <Fact name="cameras">{cameras.length}</Fact>
        <Fact name="frame">{frameName(calibration)}</Fact>
        <Fact name="sessions">{(calibration.session_ids ?? []).join(', ')}</Fact>
        <Fact name="solved in">{fixed(durationSeconds(calibration.run?.solve_duration), 1)} s</Fact>
        <Fact name="made">{dateTime(timeMs(calibration.run?.end_time))}</Fact>
      </dl>
      {accuracy.problem !== '' && <p class="hint">Expected errors: {accuracy.problem}</p>}
      <div class="buttons use"><Activate key={turn} calibration={calibration} onChange={onActive} />
        {([['frame', 'Floor and origin'], ['downloads', 'Downloads']] as const).map(([panel, words]) =>
          <button key={panel} type="button" onClick={() => document.querySelector(`.panel.${panel}`)?.scrollIntoView()}>{words}</button>)}</div>
    </Panel>
    <Panel name="findings" title={`Findings (${calibration.findings?.length ?? 0})`}>
      {!calibration.findings?.length && <p><Chip mark="good">Nothing found</Chip></p>}
      <FirstOf items={calibration.findings ?? []} step={fewCameras}>{(first) => <ul class="findings">{first.map((finding, i) => <FindingRow key={i} finding={finding} />)}</ul>}</FirstOf>
    </Panel>
    <Panel name="percamera" title={many ? `Cameras (${cameras.length})` : 'Cameras'}>
      {many && <SearchField text={text} label="Find a camera, here and below" onChange={setText} />}
      {shown.length === 0 ? <p class="empty">No camera has this in its name.</p> : <CameraTable cameras={shown} worstFirst={many} />}
    </Panel>
    <div class="pair">
    <Panel name="residuals" title="Residuals"><ResidualChart cameras={shown} /></Panel>
    <Panel name="offsets" title="Time offsets"><TimeOffsetChart cameras={shown} /></Panel>
    </div>
    <Panel name="space" title="Rig">
      <SceneView model={model} goalMm={goal.value} theme={theme} label="Cameras, their uncertainty, and the expected error"
        note={model.ellipsoids.size > 0 ? 'blue: position sigmas, enlarged' : ''} />
    </Panel>
    <Panel name="vectors" title="Residuals over the image"><ResidualVectors id={id} theme={theme} order={many ? shown.map((one) => one.camera ?? '') : undefined} /></Panel>
    <div class="pair finish">
    <FramePanel key={id} calibration={calibration} />
    <ActiveHistory rig={calibration.rig ?? ''} turn={turn} onChange={onActive} />
    <Panel name="target" title="Wand">
      <div class="scroll" tabIndex={0} role="region" aria-label="Spans of the wand"><table>
        <thead><tr><th scope="col">span, mm</th><th scope="col">mean error, mm</th><th scope="col">RMS, mm</th><th scope="col">held out RMS, mm</th><th scope="col">measured</th></tr></thead>
        <tbody>{(calibration.target?.spans ?? []).map((one, i) => <tr key={i}>
          <th scope="row">{fixed((one.length_m ?? 0) * 1e3, 2)}</th><td>{fixed((one.mean_error_m ?? 0) * 1e3, 3)}</td>
          <td>{fixed((one.error_rms_m ?? 0) * 1e3, 3)}</td>
          <td>{one.held_out_count ? fixed((one.held_out_error_rms_m ?? 0) * 1e3, 3) : missing}</td><td>{count(one.count)}</td></tr>)}</tbody>
      </table></div>
      {(calibration.other_targets ?? []).map((one, i) => <p class="hint" key={i}>{otherTargetText(one)}</p>)}
    </Panel>
    </div>
    <Panel name="downloads" title="Downloads">
      <Downloads id={id} accuracy={accuracy.value} />
    </Panel>
    <Compare calibration={calibration} others={others} withId={withId} />
  </>;
}

const severities: Record<string, readonly [Mark, string]> = {
  FINDING_SEVERITY_ERROR: ['bad', 'error'], FINDING_SEVERITY_WARNING: ['warn', 'warning'], FINDING_SEVERITY_INFO: ['info', 'note'],
};

function FindingRow({ finding }: { finding: Finding }): JSX.Element {
  const [mark, word] = severities[finding.severity ?? ''] ?? ['info', 'note'];
  return <li class={mark}><Chip mark={mark}>{word}</Chip>
    <b>{enumWords(finding.kind, 'FINDING_KIND_')}</b>{finding.camera && <span>{finding.camera}</span>}
    {finding.value !== undefined && <span class="numbers">{Number(finding.value.toPrecision(3))} {finding.unit}</span>}
    {finding.advice && finding.advice !== '-' && <span class="text">{finding.advice}</span>}</li>;
}

interface Column {
  name: string;
  title: string;
  value: (camera: CalibratedCamera) => number | string;
  show: (camera: CalibratedCamera) => ComponentChildren;
}

const shareOfOutliers = (camera: CalibratedCamera): number =>
  (camera.residuals?.outlier_count ?? 0) / Math.max(1, camera.residuals?.all?.marker_count ?? 0);
const positionSigma = (camera: CalibratedCamera): number | undefined => {
  const sigma = camera.uncertainty?.position_sigma_m;
  return sigma ? Math.hypot(sigma.x ?? 0, sigma.y ?? 0, sigma.z ?? 0) : undefined;
};
const rotationSigma = (camera: CalibratedCamera): number | undefined => {
  const sigma = camera.uncertainty?.rotation_sigma_rad;
  return sigma ? Math.hypot(sigma.x ?? 0, sigma.y ?? 0, sigma.z ?? 0) : undefined;
};
const degrees = (rad: number | undefined) => (rad === undefined ? undefined : (rad * 180) / Math.PI);

const columns: readonly Column[] = [
  { name: 'camera', title: 'Name', value: (c) => c.camera ?? '', show: (c) => c.camera },
  { name: 'RMS px', title: 'Reprojection error of the inliers', value: (c) => c.residuals?.inlier?.rms_px ?? 0, show: (c) => fixed(c.residuals?.inlier?.rms_px, 2) },
  { name: 'held out px', title: 'Mean error on time blocks that were held out', value: (c) => c.held_out?.mean_px ?? 0, show: (c) => (c.held_out?.marker_count ? fixed(c.held_out.mean_px, 2) : missing) },
  { name: 'left out px', title: 'Mean error against markers triangulated from the other cameras', value: (c) => c.leave_one_out?.mean_px ?? 0, show: (c) => (c.leave_one_out?.marker_count ? fixed(c.leave_one_out.mean_px, 2) : missing) },
  { name: 'outliers', title: 'Share of the markers that were classified as outliers', value: shareOfOutliers, show: (c) => percent(shareOfOutliers(c), 1) },
  { name: 'wand views', title: 'Observations with the wand', value: (c) => c.wand_count ?? 0, show: (c) => count(c.wand_count ?? 0) },
  { name: 'σ position mm', title: 'One sigma of its centre, relative to the reference camera', value: (c) => positionSigma(c) ?? 0, show: (c) => { const s = positionSigma(c); return s === undefined ? missing : millimetres(s * 1e3); } },
  { name: 'σ rotation °', title: 'One sigma of its orientation', value: (c) => rotationSigma(c) ?? 0, show: (c) => fixed(degrees(rotationSigma(c)), 4) },
  { name: 'offset ms', title: 'Time offset to the median clock', value: (c) => c.time_offset_s ?? 0, show: (c) => inMs(c.time_offset_s ?? 0) },
  { name: 'σ offset ms', title: 'One sigma of it', value: (c) => c.uncertainty?.time_offset_sigma_s ?? 0, show: (c) => (c.uncertainty?.time_offset_sigma_s ? inMs(c.uncertainty.time_offset_sigma_s) : missing) },
  { name: 'f px', title: 'Focal length', value: (c) => c.intrinsics?.fx_px ?? 0, show: (c) => fixed(c.intrinsics?.fx_px, 1) },
  { name: 'lens', title: 'Whether the intrinsics were refined here', value: (c) => (c.intrinsics_refined ? 1 : 0), show: (c) => (c.intrinsics_refined ? 'refined' : 'as given') },
];

/** `worstFirst`: in the order in which they come, until a column is chosen. */
function CameraTable({ cameras, worstFirst }: { cameras: readonly CalibratedCamera[]; worstFirst: boolean }): JSX.Element {
  const [order, setOrder] = useState({ column: worstFirst ? -1 : 0, down: false });
  const sorted = useMemo(() => {
    if (order.column < 0) return cameras;
    const value = columns[order.column]!.value;
    return [...cameras].sort((a, b) => {
      const [x, y] = [value(a), value(b)];
      const up = typeof x === 'number' && typeof y === 'number' ? x - y : String(x).localeCompare(String(y), 'en', { numeric: true });
      return order.down ? -up : up;
    });
  }, [cameras, order]);
  return <FirstOf items={sorted} step={fewCameras}>{(first) => <div class="scroll" tabIndex={0} role="region" aria-label="Result for each camera"><table>
    <thead><tr>{columns.map((column, i) => <th key={column.name} scope="col" title={column.title}
      aria-sort={order.column !== i ? 'none' : order.down ? 'descending' : 'ascending'}>
      <button type="button" class="sort" onClick={() => setOrder({ column: i, down: order.column === i && !order.down })}>
        {column.name}<span aria-hidden="true">{order.column !== i ? '' : order.down ? ' ▾' : ' ▴'}</span></button></th>)}</tr></thead>
    <tbody>{first.map((camera) => <tr key={camera.camera}>{columns.map((column, i) => i === 0
      ? <th key={column.name} scope="row">{column.show(camera)}</th> : <td key={column.name}>{column.show(camera)}</td>)}</tr>)}</tbody>
  </table></div>}</FirstOf>;
}

function Compare({ calibration, others, withId }: { calibration: Calibration; others: readonly Calibration[]; withId: string }): JSX.Element {
  const id = calibration.id ?? '';
  const usable = others.filter((one) => one.id !== id && one.state === 'STATE_SUCCEEDED');
  const other = useLoaded(`with ${withId}`, (signal) => (withId === '' ? Promise.resolve(undefined) : getCalibration(withId, signal)));
  const comparison = useMemo(() => (other.value ? compareCalibrations(calibration, other.value) : undefined), [calibration, other.value]);
  const moved = comparison?.cameras ?? [];
  const compared = moved.length <= fewCameras ? moved : [...moved].sort((a, b) => (b.positionSigmas ?? 0) - (a.positionSigmas ?? 0));
  return <Panel name="compare" title="Comparison">
    <label>With <select value={withId} onChange={(event) => { location.hash = hashOf('result', id, { with: event.currentTarget.value }); }}>
      <option value="">nothing</option>
      {usable.map((one) => <option key={one.id} value={one.id}>{one.id} · {one.rig} v{one.version} · {calibrationMark(one)[1]}</option>)}
    </select></label>
    <Problem text={other.problem} />
    {comparison && <>
      <p class="hint">{comparison.reference === '' ? 'They have no camera in common.'
        : `${id} minus ${withId}, both as seen from ${comparison.reference}. More than 3 sigmas is more than chance.`}</p>
      <FirstOf items={compared} step={fewCameras}>{(first) => <div class="scroll" tabIndex={0} role="region" aria-label="Differences"><table>
        <thead><tr><th scope="col">camera</th><th scope="col">moved mm</th><th scope="col">sigmas</th><th scope="col">turned °</th>
          <th scope="col">f %</th><th scope="col">offset ms</th><th scope="col">held out px</th></tr></thead>
        <tbody>{first.map((one) => <tr key={one.camera} class={(one.positionSigmas ?? 0) > 3 ? 'notable' : ''}>
          <th scope="row">{one.camera}</th><td>{millimetres(one.positionMm)}</td>
          <td>{(one.positionSigmas ?? 0) > 3 && <span title="More than chance">▲ </span>}{fixed(one.positionSigmas, 1)}</td>
          <td>{fixed(one.rotationDeg, 3)}</td><td>{fixed(one.focalPercent, 2)}</td><td>{fixed(one.timeMs, 3)}</td>
          <td>{fixed(one.heldOutPx, 3)}</td></tr>)}</tbody>
      </table></div>}</FirstOf></>}
    {usable.length === 0 && <p class="hint">There is no other calibration to compare with.</p>}
  </Panel>;
}

/** How long a calibration has taken, or takes. */
export function calibrationSpan(calibration: Calibration): string {
  const seconds = durationSeconds(calibration.run?.solve_duration);
  return seconds === undefined ? missing : seconds < 60 ? `${fixed(seconds, 1)} s` : span(seconds);
}
