// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { useState } from 'preact/hooks';
import { timeMs, toDuration } from '../api/json_values';
import { createToken, whyNobodyJoins } from '../api/server_api';
import type { CreateTokenResponse, Role } from '../api/types';
import { useFeed } from '../shell/feed_context';
import { Chip, Copyable, Panel, Problem, WorkButton } from '../shell/parts';
import { useLoaded } from '../shell/use_async';
import { dateTime } from '../view/format';
import { serverAddresses } from './join_string';
import { QrCode } from './qr_code';

const roles: readonly (readonly [Role, string, string])[] = [
  ['ROLE_AGENT', 'A PC with cameras', 'writes its own cameras and nothing else'],
  ['ROLE_OPERATOR', 'A person who calibrates', 'starts, stops, calibrates, deletes'],
  ['ROLE_VIEWER', 'A person who looks', 'reads'],
];

const isOwnPc = (host: string): boolean => ['localhost', '[::1]'].includes(host) || host.startsWith('127.');

/** The command that a join string is for. */
export function joinCommand(role: Role, joinString: string): string {
  return role === 'ROLE_AGENT' ? `rigcal-agent join ${joinString}` : `rigcal login ${joinString}`;
}

/** Which agents are here. */
function Connected(): JSX.Element {
  const { rig, stale } = useFeed();
  return <Panel name="who" title="Connected now">
      <ul class="plain">{rig.agents.map((agent) => <li key={agent.agent_id}>{stale ? <Chip mark="idle">not known</Chip>
        : <Chip mark={agent.connected ? 'good' : 'bad'}>{agent.connected ? 'connected' : 'away'}</Chip>}
        <b>{agent.agent_id}</b> <span class="hint">{agent.host}</span></li>)}</ul>
      {rig.agents.length === 0 && <p class="empty">No agent yet. It appears here as soon as it has joined.</p>}
    </Panel>;
}

/** What to do where this page cannot make a join string. */
function CannotJoin({ loopback, problem }: { loopback: boolean; problem: string }): JSX.Element {
  if (!loopback) {
    return <Panel name="make" title="Join this server">
      <p>Join strings are made by an admin: on the server's own PC, with this page or with <code>rigcal token create</code>.</p>
      <p class="hint">{problem}</p></Panel>;
  }
  return <Panel name="make" title="This server is for its own PC only">
    <p>Agents, commands and this page on the server's PC find it by themselves; nobody needs to join. To let other PCs and phones in,
      end the server and start it with the same data folder and</p>
    <Copyable text="rigcal-server --listen 0.0.0.0" label="Command" />
    <ul class="steps"><li>It prints the address of this page for the network, <code>https://…:7421</code>.</li>
      <li>A browser elsewhere warns of its certificate once, because the server has made it itself.</li>
      <li>Then this page makes the join string of the next PC, and the link with QR code for a phone.</li></ul>
    <p class="hint">Cameras on this PC need an agent only: <code>rigcal-agent --source …</code> (<code>rigcal-agent sources</code> lists what there is).</p>
  </Panel>;
}

/** Brings the next PC, or the next person, to this server. */
export function JoinPage(): JSX.Element {
  const [role, setRole] = useState<Role>('ROLE_AGENT');
  const [hours, setHours] = useState('1');
  const [name, setName] = useState('');
  const [made, setMade] = useState<{ role: Role; response: CreateTokenResponse }>();
  const command = made ? joinCommand(made.role, made.response.join_string ?? '') : '';
  const local = isOwnPc(location.hostname);
  const text = made?.response.join_string ?? '';
  // Here the page's own address leads nowhere else: the string knows others.
  const origin = !local ? location.origin : serverAddresses(text).find((one) => !isOwnPc(new URL(one).hostname))
    ?? serverAddresses(text)[0] ?? location.origin;
  // The token is in the hash, which browsers send to nobody.
  const link = made && made.role !== 'ROLE_AGENT' ? `${origin}/login#token=${text}` : '';
  const may = useLoaded('join', (signal) => whyNobodyJoins(signal));
  if (may.value && may.value.problem !== '') return <div class="join"><CannotJoin {...may.value} /><Connected /></div>;
  return <div class="join">
    <Panel name="make" title="Join this server">
      <fieldset><legend>Who joins</legend>
        {roles.map(([value, word, what]) => <label key={value} class="choice">
          <input type="radio" name="role" checked={role === value} onChange={() => { setRole(value); setMade(undefined); }} />
          <span><b>{word}</b> <span class="hint">{what}</span></span></label>)}
      </fieldset>
      <div class="fields">
        <label>Name<input value={name} maxLength={64} placeholder="chosen by who joins" onInput={(event) => setName(event.currentTarget.value)} /></label>
        <label>Can be used for<select value={hours} onChange={(event) => setHours(event.currentTarget.value)}>
          <option value="0.25">15 minutes</option><option value="1">1 hour</option><option value="24">1 day</option><option value="168">1 week</option></select></label>
      </div>
      <WorkButton kind="primary" work={async () => {
        setMade({ role, response: await createToken({ role, name: name.trim() || undefined, ttl: toDuration(Number(hours) * 3600) }) });
      }}>Make a join string</WorkButton>
      <Problem text={may.problem} />
      {local && <p class="hint">This page was opened on the server's own PC, where nobody needs to join:
        agents and commands on this PC find the server by themselves.</p>}
    </Panel>
    {made && <Panel name="made" title={link === '' ? 'Run this on the other PC' : 'Open this page elsewhere'}>
      {link !== '' && <Copyable text={link} label="Link" />}
      {link !== '' && <p class="hint">Or, for the command line there:</p>}
      <Copyable text={command} label="Command" />
      <div class="qrbox"><QrCode text={link || command} label={link === '' ? 'QR code of the command' : 'QR code of the link'} />
        <ul><li>It can be used once, until {dateTime(timeMs(made.response.token?.expire_time))}.</li>
          <li>Whoever has it can join: show it to nobody else.</li>
          <li>{link === '' ? 'The QR code holds the same command, for a phone or a tablet that passes it on.'
            : 'A phone that scans the QR code opens this page.'}</li>
          {link !== '' && <li>▲ The browser there warns of the certificate once, because the server has made it itself:
            choose <b>Advanced</b>, then <b>Proceed</b> (Firefox: <b>Accept the Risk</b>; Safari: <b>Show Details</b>, then <b>visit this website</b>).</li>}
          {link !== '' && isOwnPc(new URL(link).hostname) && <li>▲ This link leads to this PC itself: the server listens on no address of the network.</li>}</ul></div>
    </Panel>}
    <Connected />
  </div>;
}
