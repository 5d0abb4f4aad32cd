// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { useEffect, useMemo, useState } from 'preact/hooks';
import { timeMs } from '../api/json_values';
import type { LiveAlert, LiveFigure } from '../api/types';
import { fewCameras as fewTiles } from '../cameras/camera_needs';
import { ManyCameras } from '../cameras/many_cameras';
import { useFeed, useFeedControl } from '../shell/feed_context';
import { Panel } from '../shell/parts';
import { hashOf } from '../shell/route';
import { changeSettings, readSettings } from '../shell/settings';
import { gradeOf, hasEnded } from '../result/grade';
import { SceneView } from '../scene/scene_view';
import { qualityRgb, rgbText } from '../view/colour_scale';
import { fixed, millimetres, missing, scaleText, span } from '../view/format';
import { modelOfEstimate } from '../view/rig_model';
import { Alerts, PairNeeds } from './alerts';
import { useCalibrationOf } from './calibration_of';
import { CameraTile } from './camera_tile';
import { FigureCurve } from './figure_curve';
import { LiveFigureRegion } from './figure_region';
import { LeastShared, mostInMatrix, OverlapMatrix } from './overlap_matrix';
import { isCapturing, progressOf } from './progress';
import { SessionControls, usableCameras } from './session_controls';

/** So many have room for their matrix under the advice. */
const fewCameras = 4;
const noHistory: readonly LiveFigure[] = [];

/** The page of whoever waves, or watches it. */
export function WavePage({ theme }: { theme: string }): JSX.Element {
  const control = useFeedControl();
  const { rig, stale } = useFeed();
  useEffect(() => {
    control.setAttention('wave');
    return () => control.setAttention('other');
  }, [control]);
  const { calibration } = useCalibrationOf(stale ? undefined : rig.session);
  const [pictures, setPictures] = useState(readSettings().pictures);
  const estimate = rig.estimate;
  const progress = progressOf(rig, stale);
  const shapes = rig.cameras.map((camera) => `${camera.camera} ${camera.image_size_px?.width} ${camera.image_size_px?.height}`).join();
  const capturing = isCapturing(rig);
  const model = useMemo(() => modelOfEstimate(estimate, rig.cameras, capturing && !stale), [estimate, shapes, capturing, stale]);
  const byCamera = useMemo(() => {
    const first = new Map<string, LiveAlert>();
    for (const alert of rig.alerts) if (alert.camera && !first.has(alert.camera)) first.set(alert.camera, alert);
    return first;
  }, [rig.alerts]);
  const volume = estimate?.volume;
  const advice = estimate?.advice ?? [];
  const needs = estimate?.needs ?? [];
  const age = timeMs(rig.time) !== undefined && timeMs(estimate?.time) !== undefined
    ? (timeMs(rig.time)! - timeMs(estimate?.time)!) / 1000 : undefined;
  return <div class={`wave${rig.cameras.length <= fewCameras ? ' few' : ''}${stale ? ' stale' : ''}${rig.session ? '' : ' idle'}`}>
    <Panel name="figure" title="Expected error" aside={<a class="button" href={hashOf('distance')}>Distance mode</a>}>
      <div class={`big stage-${progress.stage}`} style={progress.nowMm === undefined || stale ? undefined
        : { borderColor: rgbText(qualityRgb(progress.quality)) }}>
        <p class="number"><span class="digits">{stale ? missing : millimetres(progress.nowMm)}</span><span class="unit">mm</span></p>
        <p class="state"><span class="stageword"><span aria-hidden="true">{progress.symbol}</span> {progress.word}</span>
          <span>{progress.goalMm !== undefined ? `goal ${millimetres(progress.goalMm)} mm` : 'no goal'}</span></p>
      </div>
      <LiveFigureRegion progress={progress} />
      {!stale && rig.session?.state === 'STATE_FINISHED' && <p class="why">The session has finished{progress.nowMm === undefined
        ? ': nothing is estimated any more' : ', and this was its last estimate'}. {calibration === undefined ? 'It has no calibration yet.'
          : <a href={hashOf('result', calibration.id)}>{calibration.id}: {gradeOf(calibration)[1]}</a>}</p>}
      {!stale && capturing && rig.goal?.why_not && <p class="why">Goes on: {rig.goal.why_not}.</p>}
      {estimate?.state === 'STATE_FAILED' && <p class="why">✕ {estimate.problem}</p>}
      {volume && estimate && !estimate.scale_known && <p class="why">The scale is not known: there is no error in millimetres.</p>}
      <FigureCurve history={estimate?.history ?? noHistory} goalMm={progress.goalMm} theme={theme} />
      <dl class="facts">
        <div class="fact" title="On top of the expected error: the scale is as good as the wand was measured"><dt>scale</dt>
          <dd>{stale || !volume ? missing : scaleText(volume.scale_sigma_rel)}</dd></div>
        <div class="fact" title="Reprojection error on data that the estimate did not use, and what it would be if the estimate were right">
          <dt>held-out check</dt><dd>{!estimate?.held_out || stale ? missing
            : `${estimate.held_out.agrees ? '✓' : '▲'} ${fixed(estimate.held_out.rms_px ?? 0, 2)} px, ${fixed(estimate.held_out.expected_rms_px ?? 0, 2)} expected`}</dd></div>
        <div class="fact"><dt>solved</dt><dd>{stale || age === undefined || !capturing ? missing : `${span(age)} ago`}</dd></div>
      </dl>
    </Panel>
    <Panel name="control" title="Session">
      <SessionControls rig={rig} stale={stale} onChange={control.retryNow} />
    </Panel>
    <Panel name="advice" title="What next">
      {stale ? <p class="empty">Not known while the server does not answer.</p>
        : needs.length > 0 && estimate?.state === 'STATE_WAITING' ? <PairNeeds needs={needs} />
          : capturing && advice.length > 0 ? <ol class="advice">{advice.map((one, i) => <li key={one.text} class={i === 0 ? 'first' : ''}>
            <span class="text">Wave {one.text}</span>
            {(one.expected_p95_mm ?? 0) > 0 && <span class="gain">5 s there: {millimetres(one.expected_p95_mm)} mm</span>}</li>)}</ol>
            : <p class="empty">{capturing ? (estimate?.state === 'STATE_READY' ? 'No place stands out: wave everywhere that two cameras see.'
              : 'Wave the wand where two cameras see it.')
              : rig.session?.state === 'STATE_FINISHED' ? (calibration === undefined ? 'Calibrate from this session, or go on with it in a new one.'
                : !hasEnded(calibration.state) ? 'Its calibration is being solved.'
                  : 'Look at its calibration, or go on with the session in a new one.')
                : usableCameras(rig).length === 0 ? 'Connect cameras first.' : 'Start a capture; advice on where to wave follows.'}</p>}
      <Alerts alerts={rig.alerts} nowMs={timeMs(rig.time)} known={!stale && rig.revision !== ''} />
    </Panel>
    <Panel name="space" title="Rig and expected error">
      <SceneView model={model} goalMm={progress.goalMm} theme={theme} label="Cameras, wand and expected error"
        note={capturing && !stale ? '○ blue: wave here · wire: worst place' : 'wire: worst place'} />
    </Panel>
    <Panel name="tiles" title={`Cameras (${rig.cameras.length})`} aside={<div class="tilesaside">{rig.cameras.length <= fewTiles && <CoverageLegend />}
      {rig.cameras.some((camera) => camera.has_preview) && <button type="button" aria-pressed={pictures}
        onClick={() => setPictures(changeSettings({ pictures: !pictures }).pictures)}>Pictures</button>}</div>}>
      {rig.cameras.length === 0 ? <p class="empty">{stale || rig.revision === '' ? 'Not known yet.' : 'No camera is connected.'}</p>
        : rig.cameras.length > fewTiles ? <ManyCameras rig={rig} model={model} stale={stale} theme={theme} pictures={pictures} alertOf={byCamera} />
        : <ul class="tilegrid" style={{ maxWidth: `${rig.cameras.length * 24.6}rem` }}>{rig.cameras.map((camera) => <CameraTile key={camera.camera} camera={camera}
          alert={byCamera.get(camera.camera ?? '')} stale={stale} theme={theme} pictures={pictures ? rig.rig : ''} state={rig.session?.id ?? ''} />)}</ul>}
    </Panel>
    <Panel name="overlap" title={rig.cameras.length > mostInMatrix ? 'Least seen together with others' : 'Common instants of pairs'}>
      {rig.cameras.length > mostInMatrix ? <LeastShared cameras={rig.cameras} /> : <OverlapMatrix overlap={rig.overlap} />}
    </Panel>
  </div>;
}

function CoverageLegend(): JSX.Element {
  return <p class="legend">coverage:
    <span><i class="cell cell0" />none</span><span><i class="cell cell1" />few</span>
    <span><i class="cell cell2" />some</span><span><i class="cell cell3" />enough</span></p>;
}
