// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { useEffect, useMemo, useState } from 'preact/hooks';
import { timeMs, toCount } from '../api/json_values';
import { listAgents } from '../api/server_api';
import type { Agent, CameraDescription, LiveCamera } from '../api/types';
import { FirstOf, SearchField } from '../cameras/camera_list';
import { type CameraNeed, fewCameras, matching, needsOf, needsText } from '../cameras/camera_needs';
import type { RigState } from '../live/live_merge';
import { useFeed } from '../shell/feed_context';
import { Chip, Meter, Panel, Problem } from '../shell/parts';
import { hashOf } from '../shell/route';
import { useLoaded } from '../shell/use_async';
import { whileVisible } from '../shell/visible';
import { bytes, count, dateTime, fixed, missing, seconds, span } from '../view/format';
import { cameraState } from '../wave/camera_tile';
import { DetectorDialog } from './detector_dialog';
import { OfferedCameras } from './offered_cameras';
import { Preview } from './preview';

const sensors: Record<string, string> = { SENSOR_FRAME: 'frame camera', SENSOR_EVENT: 'event camera' };

function CameraCard({ live, description, rig, stale, session, need }: {
  live: LiveCamera; description: CameraDescription | undefined; rig: string; stale: boolean; session: string;
  need?: CameraNeed;
}): JSX.Element {
  const [mark, word] = cameraState(live);
  const settings = description?.settings;
  const clock = live.clock;
  const epochs = clock?.clock_epoch_count ?? 0;
  const [open, setOpen] = useState(false);
  const name = live.camera ?? '';
  return <li class="cameracard">
    <div class="head"><h3>{live.camera}</h3><Chip mark={stale ? 'idle' : mark}>{stale ? 'not known' : word}</Chip></div>
    {!stale && need && need.why !== '' && <p class="need"><Chip mark={need.mark}>{need.why}</Chip></p>}
    {live.has_preview && live.state !== 'STATE_OFFLINE' ? <Preview rig={rig} camera={name}
      state={`${live.state} ${live.agent_id} ${session}`} />
      : <div class="preview nothing"><p>{live.state === 'STATE_OFFLINE' ? 'its agent is not connected' : 'this camera gives no previews'}</p></div>}
    <dl class="facts">
      <div class="fact"><dt>agent</dt><dd>{live.agent_id || 'given by hand'}</dd></div>
      <div class="fact"><dt>sensor</dt><dd>{sensors[description?.sensor ?? ''] ?? missing}, {live.image_size_px?.width ?? '?'}×{live.image_size_px?.height ?? '?'}</dd></div>
      <div class="fact"><dt>rate</dt><dd>{stale ? missing : `${fixed(live.observation_rate_hz ?? 0, 0)} Hz, ${fixed(live.wand_rate_hz ?? 0, 0)} with wand`}</dd></div>
      <div class="fact"><dt>lens</dt><dd>{description?.intrinsics ? '✓ intrinsics given' : <>▲ none: <a href={hashOf('lens')}>make one</a></>}</dd></div>
      <div class="fact"><dt>clock</dt><dd>{description?.clock?.clock_id ?? missing}{description?.clock?.timebase ? `, ${description.clock.timebase}` : ''}{settings?.ptp ? ', PTP' : ''}</dd></div>
      <div class="fact"><dt>offset found</dt><dd>{clock?.time_offset_s === undefined ? missing : `${seconds(clock.time_offset_s)} ± ${seconds(clock.time_offset_sigma_s)}`}</dd></div>
      <div class="fact"><dt>sample spread</dt><dd>{seconds(clock?.sample_spread_s)}{epochs > 1 ? ` ▲ jumped ${epochs - 1}×` : ''}</dd></div>
      {!!clock?.wand && <div class="fact"><dt>light code</dt><dd>✓ wand {clock.wand}, on for {span(clock.wand_time_s)}</dd></div>}
      {settings && <div class="fact"><dt>settings</dt><dd>{[settings.model, settings.exposure_s ? `exposure ${seconds(settings.exposure_s)}` : '',
        settings.gain_db ? `gain ${fixed(settings.gain_db, 1)} dB` : '', settings.frame_rate_hz ? `${fixed(settings.frame_rate_hz, 0)} Hz` : '',
        settings.trigger ? `trigger ${settings.trigger}` : ''].filter(Boolean).join(', ')}</dd></div>}
      <div class="fact"><dt>waiting / lost</dt><dd>{count(toCount(live.backlog_count))} / {count(toCount(live.dropped_count))}</dd></div>
    </dl>
    {live.agent_id && live.state !== 'STATE_OFFLINE' && description?.sensor !== 'SENSOR_EVENT' &&
      <div class="buttons"><button type="button" disabled={stale} aria-haspopup="dialog" aria-label={`Mask and colour of ${name}`}
        onClick={() => setOpen(true)}>Mask and colour</button></div>}
    {open && <DetectorDialog rig={rig} camera={name} onClose={() => setOpen(false)} />}
  </li>;
}

/** An agent; `connected` is undefined where the server does not answer. */
function AgentRow({ agent, connected }: { agent: Agent; connected: boolean | undefined }): JSX.Element {
  const spool = agent.spool;
  const [used, limit] = [toCount(spool?.bytes), toCount(spool?.limit_bytes)];
  return <tr>
    <th scope="row">{agent.agent_id}</th>
    <td>{connected === undefined ? <Chip mark="idle">not known</Chip> : <Chip mark={connected ? 'good' : 'bad'}>{connected ? 'connected' : 'away'}</Chip>}
      {connected === false && agent.disconnect_time && <span class="hint"> since {dateTime(timeMs(agent.disconnect_time))}</span>}</td>
    <td>{agent.host}</td><td>{agent.rig}</td><td>{agent.cameras?.length ?? 0}</td>
    <td>{count(toCount(spool?.row_count))}</td>
    <td>{limit > 0 ? <><Meter share={used / limit} label={`Spool of ${agent.agent_id}`} /> {bytes(used)} of {bytes(limit)}</> : missing}
      {spool?.problem && <p class="problem">✕ {spool.problem}</p>}</td>
    <td>{agent.software_version}</td>
  </tr>;
}

/** The cards of a large rig: a search, those that need something first, and as many as fit a screen. */
function ManyCards({ rig, card }: { rig: RigState; card: (camera: LiveCamera, need: CameraNeed) => JSX.Element }): JSX.Element {
  const [text, setText] = useState('');
  const needs = useMemo(() => needsOf(rig.cameras, rig.alerts), [rig.cameras, rig.alerts]);
  const found = useMemo(() => matching(needs, text), [needs, text]);
  return <>
    <p class="summary">{needsText(needs)}</p>
    <SearchField text={text} label="Find a camera" onChange={setText} />
    {found.length === 0 ? <p class="empty">No camera has this in its name, its agent or what it needs.</p>
      : <FirstOf items={found} step={12}>{(shown) => <ul class="cameragrid">{shown.map((need) => card(need.camera, need))}</ul>}</FirstOf>}
  </>;
}

/** Agents of many: those that are away, or whose spool has a problem, first. */
function awayFirst(agents: readonly Agent[], isConnected: (agent: Agent) => boolean): Agent[] {
  const rank = (agent: Agent): number => (!isConnected(agent) ? 0 : agent.spool?.problem ? 1 : 2);
  return [...agents].sort((a, b) => rank(a) - rank(b));
}

/** PCs, cameras, clocks and the server. */
export function RigPage(): JSX.Element {
  const { rig, stale, status } = useFeed();
  const agents = useLoaded('agents', (signal) => listAgents(signal), 3000);
  const all = agents.value?.agents ?? [];
  const connected = new Map(rig.agents.map((agent) => [agent.agent_id, agent.connected ?? false]));
  const descriptions = new Map(all.filter((agent) => !rig.rig || !agent.rig || agent.rig === rig.rig)
    .flatMap((agent) => agent.cameras ?? []).map((camera) => [camera.camera, camera]));
  const started = timeMs(status?.start_time);
  const [now, setNow] = useState(Date.now());
  useEffect(() => {
    return whileVisible(5000, () => setNow(Date.now()));
  }, []);
  const [agentText, setAgentText] = useState('');
  const [allAgents, setAllAgents] = useState(false);
  const ofSearch = all.length <= fewCameras ? all
    : awayFirst(all, (agent) => connected.get(agent.agent_id) ?? agent.connected ?? false)
      .filter((agent) => `${agent.agent_id} ${agent.host}`.toLowerCase().includes(agentText.trim().toLowerCase()));
  const shownAgents = allAgents ? ofSearch : ofSearch.slice(0, fewCameras);
  const store = status?.store;
  const problem = status?.ingest?.problem || store?.problem || '';
  const card = (camera: LiveCamera, need?: CameraNeed): JSX.Element => <CameraCard key={camera.camera} live={camera} rig={rig.rig} stale={stale}
    session={rig.session?.id ?? ''} description={descriptions.get(camera.camera)} need={need} />;
  return <div class="rigpage">
    <Panel name="agents" title={`Agents (${all.length})`} aside={<a class="button" href={hashOf('join')}>Connect a PC</a>}>
      <Problem text={agents.problem} />
      {all.length > 0 && <div class="scroll" tabIndex={0} role="region" aria-label="Agents"><table>
        <thead><tr><th scope="col">agent</th><th scope="col">state</th><th scope="col">PC</th><th scope="col">rig</th><th scope="col">cameras</th>
          <th scope="col">waiting</th><th scope="col">spool</th><th scope="col">version</th></tr></thead>
        <tbody>{shownAgents.map((agent) => <AgentRow key={agent.agent_id} agent={agent}
          connected={stale ? undefined : connected.get(agent.agent_id) ?? agent.connected ?? false} />)}</tbody>
      </table></div>}
      {all.length > fewCameras && <SearchField text={agentText} label="Find an agent or a PC" onChange={setAgentText} />}
      {ofSearch.length > shownAgents.length && <button type="button" class="more" onClick={() => setAllAgents(true)}>Show all {ofSearch.length} agents</button>}
      {all.length === 0 && !agents.loading && <p class="empty">No agent is connected. <a href={hashOf('join')}>Connect a PC</a></p>}
    </Panel>
    <OfferedCameras agents={all} stale={stale} onDone={agents.reload} />
    <Panel name="server" title="Server">
      <Problem text={problem} />
      <dl class="facts">
        <div class="fact"><dt>state</dt><dd>{stale ? '⚠ does not answer' : problem ? '✕ see above' : '✓ healthy'}</dd></div>
        <div class="fact"><dt>version</dt><dd>{status?.software_version ?? missing}</dd></div>
        <div class="fact"><dt>runs for</dt><dd>{started === undefined || stale ? missing : span((now - started) / 1000)}</dd></div>
        <div class="fact"><dt>observations stored</dt><dd>{count(toCount(status?.ingest?.stored_observation_count))}</dd></div>
        <div class="fact"><dt>database</dt><dd>{bytes(toCount(store?.size_bytes))}</dd></div>
        <div class="fact"><dt>free on its disk</dt><dd>{bytes(toCount(store?.free_bytes))}</dd></div>
        <div class="fact"><dt>newest data shown after</dt><dd>{stale ? missing : seconds(rig.ageS)}</dd></div>
      </dl>
    </Panel>
    <Panel name="cameras" title={`Cameras (${rig.cameras.length})`}>
      {rig.cameras.length > fewCameras ? <ManyCards rig={rig} card={card} /> : <ul class="cameragrid">{rig.cameras.map((camera) => card(camera))}</ul>}
    </Panel>
  </div>;
}
