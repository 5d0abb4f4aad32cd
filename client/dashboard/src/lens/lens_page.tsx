// SPDX-License-Identifier: Apache-2.0
// Lenses of cameras from a printed board: hold it before a camera, see what is missing, take the file.
import type { JSX } from 'preact';
import { useMemo, useRef, useState } from 'preact/hooks';
import { toCount } from '../api/json_values';
import { createCalibration, createSession, getLens, getSession, listSessions, startSession, stopSession } from '../api/server_api';
import type { CameraIntrinsics, Lens, Session } from '../api/types';
import { PreviewImage } from '../rig/preview';
import { Canvas } from '../shell/canvas';
import { useFeed, useFeedControl } from '../shell/feed_context';
import { Chip, Fact, Panel, Problem, saveFile, WorkButton } from '../shell/parts';
import { hashOf, type Route } from '../shell/route';
import { changeSettings, readSettings } from '../shell/settings';
import { useLoaded } from '../shell/use_async';
import { count, fixed, missing, percent } from '../view/format';
import { usualBoard } from '../view/target_text';
import { NoCameras, sessionState, usableCameras } from '../wave/session_controls';
import { drawUncertainty, drawViews, shortPx } from './draw_lens';
import { chooseCamera, chooseSession, isBehind, isBoardSession, lensCameras, lensState } from './lens_state';

/** As wide as there is room, and of the shape of the camera's image. */
const shapeOf = (lens: Lens): { aspectRatio: string } => ({ aspectRatio: `${lens.image_size_px?.width || 4} / ${lens.image_size_px?.height || 3}` });

/** What the camera sees now, and on it where the board has been. */
function Views({ lens, rig, live, theme }: { lens: Lens; rig: string; live: string; theme: string }): JSX.Element {
  const image = useRef<HTMLImageElement>(null);
  const [shown, setShown] = useState(false);
  const draw = useMemo(() => drawViews(lens, shown), [lens, shown, theme]);
  const corners = (lens.views ?? []).reduce((sum, view) => sum + (view.x_px?.length ?? 0), 0);
  return <div class="lensview" style={shapeOf(lens)}>
    {live !== '' && <PreviewImage image={image} rig={rig} camera={lens.camera ?? ''} state={live} onShown={setShown} />}
    <Canvas draw={draw} label={`${lens.camera}: ${count(corners)} corners of ${lens.views?.length ?? 0} views, in ${percent(lens.covered_share ?? 0)} of the image${lens.next_pose?.words ? `; next: ${lens.next_pose.words}` : ''}`} />
  </div>;
}

/** The numbers of a lens that has been made, and its file. */
function Result({ lens }: { lens: Lens }): JSX.Element {
  const result = lens.result;
  const intrinsics = result?.intrinsics;
  const file = `${lens.camera}.yaml`;
  return <>
    {result && <dl class="facts">
      <Fact name="model" title="Chosen by the error in views that the lens was made without">{result.model}</Fact>
      <Fact name="focal length">{intrinsics ? `${fixed(intrinsics.fx_px, 1)}, ${fixed(intrinsics.fy_px, 1)} px` : missing}</Fact>
      <Fact name="middle">{intrinsics ? `${fixed(intrinsics.cx_px, 1)}, ${fixed(intrinsics.cy_px, 1)} px` : missing}</Fact>
      <Fact name="held-out error" title="RMS in views that the lens was made without">{fixed(result.held_out_rms_px ?? 0, 3)} px</Fact>
      <Fact name="error" title="RMS in the views that the lens was made from">{fixed(result.rms_px ?? 0, 3)} px</Fact>
      <Fact name="two halves differ by" title="Two lenses from half of the views each, in 95 % of the image">
        {result.halves_p95_px === undefined ? missing : `${shortPx(result.halves_p95_px)} px`}</Fact>
      <Fact name="uncertainty" title="In 95 % of the image">{lens.uncertainty ? `${shortPx(lens.uncertainty.p95_px ?? 0)} px` : missing}</Fact>
      <Fact name="views, corners">{count(result.view_count ?? 0)}, {count(result.corner_count ?? 0)}</Fact>
    </dl>}
    {!!result?.advice?.length && <ul class="reasons">{result.advice.map((sentence) => <li key={sentence}>{sentence}</li>)}</ul>}
    <div class="buttons">
      <button type="button" class="primary" disabled={!result} onClick={() =>
        saveFile(file, 'application/yaml', result?.opencv_yaml ?? '')}>Download {file}</button>
      {result && <span class="hint">OpenCV YAML, for <code>calibration={file}</code> of the camera's agent</span>}
    </div>
    {!!result?.candidates?.length && <details><summary>Models that were tried</summary>
      <div class="scroll" tabIndex={0} role="region" aria-label="Models"><table>
        <thead><tr><th scope="col">model</th><th scope="col">held-out error, px</th><th scope="col">error, px</th></tr></thead>
        <tbody>{result.candidates.map((one) => <tr key={one.model}><th scope="row">{one.model}{one.model === result.model ? ' ✓' : ''}</th>
          <td>{fixed(one.held_out_rms_px ?? 0, 3)}</td><td>{fixed(one.rms_px ?? 0, 3)}</td></tr>)}</tbody></table></div></details>}
  </>;
}

/** What has been seen with a camera, what to show it next, and its lens. */
function CameraLens({ session, camera, rig, theme }: { session: Session; camera: string; rig: string; theme: string }): JSX.Element {
  const id = session.id ?? '';
  const loaded = useLoaded(`lens ${id} ${camera}`, (signal) => getLens(id, camera, signal), 1500);
  const lens = loaded.value;
  const [mark, word] = lensState(lens);
  const uncertainty = useMemo(() => drawUncertainty(lens ?? {}), [lens, theme]);
  const live = session.state === 'STATE_CAPTURING' ? `${session.state} ${id}` : '';
  const left = (lens?.views ?? []).filter((view) => view.left_out);
  return <>
    <Panel name="views" title={`Where the board has been: ${camera}`} aside={<span class="hint">{lens?.views?.length ?? 0} views, {percent(lens?.covered_share ?? 0)} covered</span>}>
      <Problem text={loaded.problem} />
      {lens && <Views lens={lens} rig={rig} live={live} theme={theme} />}
      <p class="legend"><span><i class="key seen" />a corner that was seen</span>
        {!!lens?.next_pose?.outline_x_px?.length && <span><i class="key outline" />hold the board here next</span>}
        {left.length > 0 && <span><i class="key out" />left out of the lens</span>}</p>
      {(lens?.bare_sides ?? []).map((side) => <p key={side}><Chip mark="warn">{side}</Chip></p>)}
    </Panel>
    <div class="pair">
      <Panel name="next" title="Next view">
        {lens?.next_pose?.words ? <p class="nextview">{lens.next_pose.words}</p>
          : <p class="nextview">{lens?.state === 'STATE_SOLVED' && !lens.result?.advice?.length ? 'Enough: the lens is good.'
            : 'Hold the board near, tilted by 30 to 50 degrees, in turn to every side, all over the image.'}</p>}
        {!!lens?.next_pose?.expected_p95_px && <p class="hint">With it the lens would be uncertain by {shortPx(lens.next_pose.expected_p95_px)} px instead
          of {shortPx(lens.uncertainty?.p95_px ?? 0)}.</p>}
        <p class="hint">{count(toCount(lens?.board_count))} of {count(toCount(lens?.observation_count))} pictures show the
          board; not taken: {count(toCount(lens?.alike_count))} like another view, {count(toCount(lens?.blurred_count))} less sharp.</p>
      </Panel>
      <Panel name="lens" title="Lens" aside={<Chip mark={mark}>{word}</Chip>}>
        {lens?.has_lens && <p class="hint">This camera had a lens when it was recorded. This one is made anew and changes nothing by itself.</p>}
        {lens?.state === 'STATE_COLLECTING' ? <p class="hint">{lens.problem}</p> : <Problem text={lens?.problem ?? ''} />}
        {lens && <Result lens={lens} />}
        {left.length > 0 && <details><summary>Views that were left out ({left.length})</summary>
          <ul class="steps">{left.map((view) => <li key={view.time_ns}>{view.left_out}</li>)}</ul></details>}
      </Panel>
    </div>
    {lens?.uncertainty && <Panel name="map" title="How uncertain the lens is, px">
      <div class="lensview" style={shapeOf(lens)}><Canvas draw={uncertainty} label={`${camera}: the lens is uncertain by ${shortPx(lens.uncertainty.median_px ?? 0)} pixels in half of the image, ${shortPx(lens.uncertainty.p95_px ?? 0)} in 95 %`} /></div>
      <p class="hint">One sigma of where the lens shows a point. Each number is the largest of its part of the image; below 0.2 is good. Strokes: the lens has no ray there.</p>
    </Panel>}
  </>;
}

/** Calibrates the session with the lenses found in it. */
async function calibrateWithLenses(session: Session): Promise<void> {
  const given: CameraIntrinsics[] = [];
  for (const camera of lensCameras(session).filter((one) => !one.hasLens)) {
    const lens = await getLens(session.id ?? '', camera.name);
    if (!lens.result || isBehind(lens)) {
      throw new Error(lens.problem ? `${camera.name}: ${lens.problem}` : `The lens of ${camera.name} is being made; press again in a few seconds.`);
    }
    given.push({ camera: camera.name, image_size_px: lens.image_size_px, intrinsics: lens.result.intrinsics });
  }
  const calibration = await createCalibration([session.id ?? ''], given.length > 0 ? { given_intrinsics: given } : undefined,
    given.length > 0 ? 'with the lenses found in the session' : '');
  location.hash = hashOf('result', calibration.id);
}

/** Starts a session of a board. */
function StartBoard({ busy, onStarted }: { busy: string; onStarted: (id: string) => void }): JSX.Element {
  const { rig, stale } = useFeed();
  const [board, setBoard] = useState(readSettings().board || usualBoard);
  const usable = usableCameras(rig);
  return <div class="start">
    {usable.length === 0 && !stale && <NoCameras />}
    <label>Board<input value={board} spellcheck={false} autocomplete="off" onInput={(event) => setBoard(event.currentTarget.value)} /></label>
    <p class="hint">Inner corners (not squares) and the side of a square in metres. Others: <code>board:charuco,10x7,0.025,0.018,5x5_100</code>,{' '}
      <code>board:aprilgrid,6x6,0.029,0.3</code>, <code>board:circles,4x11,0.02</code>. In a terminal, <code>rigcal board print {board}</code> makes one to print.</p>
    {busy !== '' && <p class="hint">Session {busy} captures something else: stop it on page Wave first.</p>}
    {usable.length > 0 && <WorkButton kind="primary" disabled={stale || busy !== '' || board.trim() === ''} work={async () => {
      changeSettings({ board });
      const session = await createSession({ rig: rig.rig || undefined, target: { kind: 'KIND_RIGID', board: board.trim() } });
      await startSession(session.id ?? '');
      onStarted(session.id ?? '');
    }}>Start capture</WorkButton>}
  </div>;
}

/** More are a list to choose from. */
const fewCameras = 4;

/** The lenses of a session. */
export function LensPage({ route, theme }: { route: Route; theme: string }): JSX.Element {
  const feed = useFeedControl();
  const { rig, stale } = useFeed();
  const current = rig.session;
  const state = `${current?.id ?? ''} ${current?.state ?? ''}`;
  const list = useLoaded(`board sessions ${rig.rig} ${state}`, (signal) => listSessions({ page_size: 100,
    filter: rig.rig ? `rig=${rig.rig}` : '' }, signal));
  const boards = (list.value?.sessions ?? []).filter(isBoardSession);
  const id = chooseSession(route.id, current, boards);
  const loaded = useLoaded(`lens session ${id} ${id === current?.id ? state : ''}`, (signal) =>
    id === '' ? Promise.resolve<Session>({}) : getSession(id, signal));
  const session = loaded.value?.id === id ? loaded.value : undefined;
  const cameras = lensCameras(session);
  const camera = chooseCamera(route.parameters.get('camera') ?? '', cameras);
  const show = (next: string, nextCamera = '') => { location.hash = hashOf('lens', next, { camera: nextCamera }); };
  const capturing = current?.state === 'STATE_CAPTURING';
  const busy = capturing && !isBoardSession(current) ? current?.id ?? '' : '';
  const [mark, word] = sessionState(session);
  const running = session?.state === 'STATE_CAPTURING';
  const without = cameras.filter((one) => !one.hasLens);
  const starting = <StartBoard busy={busy} onStarted={(started) => {
    feed.retryNow();
    list.reload();
    show(started);
  }} />;
  return <div class="lenspage">
    <Panel name="which" title="Session" aside={boards.length > 1 && <label>Session <select value={id} onChange={(event) => show(event.currentTarget.value)}>
      {!boards.some((one) => one.id === id) && id !== '' && <option key={id}>{id}</option>}
      {boards.map((one) => <option key={one.id} value={one.id}>{one.id}{one.title ? `, ${one.title}` : ''}</option>)}</select></label>}>
      <Problem text={loaded.problem || list.problem} />
      {session && <>
        <p class="line"><Chip mark={stale ? 'idle' : mark}>{stale ? 'not known' : word}</Chip><span class="strong">{session.id}</span>
          <span>{session.target?.board || 'its target is no board'}</span></p>
        {cameras.length > fewCameras && <label class="whichcamera">Camera <select value={camera} onChange={(event) => show(id, event.currentTarget.value)}>
          {cameras.map((one) => <option key={one.name} value={one.name}>{one.name} {one.hasLens ? '✓ lens given' : '▲ no lens'}</option>)}</select></label>}
        {cameras.length > 0 && cameras.length <= fewCameras && <div class="buttons cameras" role="group" aria-label="Camera">{cameras.map((one) =>
          <button key={one.name} type="button" aria-pressed={one.name === camera} onClick={() => show(id, one.name)}>
            {one.name} <Chip mark={one.hasLens ? 'good' : 'warn'}>{one.hasLens ? 'lens given' : 'no lens'}</Chip></button>)}</div>}
        <div class="buttons">
          {running && <WorkButton kind="danger" disabled={stale} work={async () => {
            await stopSession(id);
            feed.retryNow();
            loaded.reload();
          }}>■ Stop capture</WorkButton>}
          {session.state === 'STATE_FINISHED' && cameras.length > 1 && isBoardSession(session) && <WorkButton disabled={stale}
            work={() => calibrateWithLenses(session)}>{without.length > 0 ? 'Calibrate the rig with these lenses' : 'Calibrate the rig'}</WorkButton>}
        </div>
      </>}
      {id === '' && !loaded.loading ? starting
        : !capturing && <details><summary>New capture of a board</summary>{starting}</details>}
    </Panel>
    {session && camera !== '' && isBoardSession(session) && <CameraLens key={`${id} ${camera}`} session={session} camera={camera} rig={rig.rig} theme={theme} />}
  </div>;
}
