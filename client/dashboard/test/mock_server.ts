// SPDX-License-Identifier: Apache-2.0
// A server for the page's tests: the page itself, and the JSON API over a simulated rig.
// Simulated time goes on with real time times `speed`, or by POST /mock/advance?s=10 where speed is 0.
// POST /mock/fail?on=1: connections are dropped. POST /mock/restart: as a server that was restarted.
import { createHash } from 'node:crypto';
import { existsSync, readFileSync } from 'node:fs';
import { createServer, type IncomingMessage, type Server, type ServerResponse } from 'node:http';
import type { AddressInfo } from 'node:net';
import { extname, join, normalize } from 'node:path';
import { gzipSync } from 'node:zlib';
import type { Activation, Calibration, CalibrationOptions, ColourRange, CreateSessionRequest, Detector, LiveState, OfferedCamera, Session, SessionCamera } from '../src/api/types';
import { mockAccuracy, mockCalibration, mockResiduals } from './mock_calibration';
import { mockLens } from './mock_lens';
import { epochMs, MockRig } from './mock_rig';

/** As the real server sends it. */
export const contentSecurityPolicy = "default-src 'none'; script-src 'self'; style-src 'self'; " +
  "img-src 'self' data: blob:; connect-src 'self'; font-src 'self'; manifest-src 'self'; base-uri 'none'; " +
  "form-action 'none'; frame-ancestors 'none'";

const types: Record<string, string> = { '.html': 'text/html; charset=utf-8', '.js': 'text/javascript; charset=utf-8',
  '.css': 'text/css; charset=utf-8', '.svg': 'image/svg+xml', '.json': 'application/json' };

class Refusal extends Error {
  constructor(readonly status: number, readonly code: string, text: string) {
    super(text);
  }
}

/** What a test may change. */
export interface MockOptions {
  dist: string;
  cameras?: number;
  /** Simulated seconds per second; 0: only by /mock/advance. */
  speed?: number;
  /** A cookie is wanted. */
  locked?: boolean;
  /** Join strings are refused, as by a server on loopback. */
  local?: boolean;
  /** It has the documentation. */
  docs?: boolean;
}

/** What an agent may offer: free, busy, not permitted, configured. */
export function foundCameras(): OfferedCamera[] {
  return [
    { device: '2345', kind: 'aravis', vendor: 'FLIR', model: 'Blackfly', address: '192.168.1.5', use: 'USE_FREE' },
    { device: '2346', kind: 'aravis', vendor: 'FLIR', model: 'Blackfly', address: '192.168.1.6', use: 'USE_BUSY',
      note: 'in use by a program at 192.168.1.9: end that program' },
    { device: '40012', kind: 'aravis', vendor: 'Basler', model: 'ace', address: '/dev/bus/usb/002/005', use: 'USE_NO_PERMISSION',
      note: 'this user may not open /dev/bus/usb/002/005: sudo adduser $USER rigcal, then sign in again' },
    { device: '40013', kind: 'aravis', vendor: 'Basler', model: 'ace', address: '192.168.1.8', use: 'USE_TAKES_PART', camera: 'frame_1', configured: true },
  ];
}

export class MockServer {
  rig: MockRig;
  readonly sessions = new Map<string, Session>();
  readonly calibrations = new Map<string, Calibration>();
  failing = false;
  startTime = new Date(epochMs).toISOString();
  generation = 1;
  readonly counts = { live: 0, unchanged: 0, previews: 0, previewsAtOnce: 0, previewsNow: 0, refusedPreviews: 0, withoutHeader: 0 };
  /** Cameras that give none. */
  readonly withoutPreviews = new Set<string>();
  readonly detectors = new Map<string, Detector>();
  /** What agent pc-1 offers. */
  readonly offered: OfferedCamera[] = [];
  /** The lens that came with the last camera. */
  lastLens = '';
  /** Views of the board that each camera has, in any session of one; cameras that are not here have a lens. */
  readonly boardViews = new Map<string, number>();
  /** Newest first. */
  readonly activations: Activation[] = [];
  /** Why the next activation is refused unless it is forced; "": it is not. */
  activationFault = '';
  /** How the next learning ends; "": well. */
  learningFault = '';
  private revision = 0;
  private parts = new Map<string, { json: string; value: unknown; revision: number }>();
  private removedAt = new Map<string, number>();
  private readonly server: Server;
  private clock: ReturnType<typeof setInterval> | undefined;
  private running = new Map<string, number>();

  constructor(private readonly options: MockOptions) {
    this.rig = new MockRig(options.cameras ?? 8);
    for (const [i, state] of (['STATE_FINISHED', 'STATE_FINISHED'] as const).entries()) {
      const id = `s-00000${i + 1}`;
      this.sessions.set(id, { id, rig: 'rig', title: i ? 'evening' : 'first try', state, camera_count: 8,
        target: { kind: 'KIND_WAND', marker_positions_m: [0, 0.13, 0.39] }, observation_count: '41600',
        wand_count: '33210', create_time: new Date(epochMs - 7200e3 + i * 3600e3).toISOString(),
        start_time: new Date(epochMs - 7190e3 + i * 3600e3).toISOString(),
        stop_time: new Date(epochMs - 7130e3 + i * 3600e3).toISOString(),
        finish_time: new Date(epochMs - 7129e3 + i * 3600e3).toISOString() });
      this.addCalibration([id]);
    }
    this.server = createServer((request, response) => void this.serve(request, response));
  }

  async listen(port = 0): Promise<string> {
    await new Promise<void>((done) => this.server.listen(port, '127.0.0.1', done));
    const speed = this.options.speed ?? 1;
    if (speed > 0) this.clock = setInterval(() => this.rig.advance(speed * 0.1), 100);
    return `http://127.0.0.1:${(this.server.address() as AddressInfo).port}`;
  }

  async close(): Promise<void> {
    clearInterval(this.clock);
    this.server.closeAllConnections();
    await new Promise((done) => this.server.close(done));
  }

  private addCalibration(sessionIds: string[]): Calibration {
    const version = this.calibrations.size + 1;
    const id = `c-00000${version}`;
    const calibration = mockCalibration(this.rig, id, version, sessionIds, version);
    this.calibrations.set(id, calibration);
    return calibration;
  }

  /** The live state since a revision; gives everything where it does not know it. */
  live(since: string): LiveState {
    const now = this.rig.parts();
    const next = this.revision + 1;
    const before = this.revision;
    const note = (name: string, value: unknown) => {
      const json = JSON.stringify(value) ?? '';
      if (this.parts.get(name)?.json !== json) {
        this.parts.set(name, { json, value, revision: next });
        this.revision = next;
      }
    };
    note('session', now.session);
    for (const camera of now.cameras) note(`camera ${camera.camera}`, camera);
    for (const name of ['overlap', 'estimate', 'alerts', 'agents', 'goal'] as const) note(name, now[name]);
    const prefix = `g${this.generation}-`;
    const revision = `${prefix}${this.revision}`;
    const known = since.startsWith(prefix) ? Number(since.slice(prefix.length)) : NaN;
    if (known === this.revision && before === this.revision) return { revision };
    const full = !(known <= this.revision);
    const changed = (name: string) => full || (this.parts.get(name)?.revision ?? 0) > known;
    const part = <T>(name: string, value: T): T | undefined => (changed(name) ? value : undefined);
    return { revision, ...(full ? { full } : {}), time: this.rig.time(), rig: 'rig',
      session: part('session', now.session), cameras: now.cameras.filter((c) => changed(`camera ${c.camera}`)),
      removed_cameras: [...this.removedAt].filter(([, at]) => full || at > known).map(([name]) => name),
      overlap: part('overlap', now.overlap), estimate: part('estimate', now.estimate),
      alerts: part('alerts', now.alerts), agents: part('agents', now.agents), goal: part('goal', now.goal),
      age_s: 0.12 } as LiveState;
  }

  restart(): void {
    this.generation += 1;
    this.revision = 0;
    this.parts.clear();
    this.startTime = new Date(epochMs + this.generation * 1000).toISOString();
  }

  private async serve(request: IncomingMessage, response: ServerResponse): Promise<void> {
    const url = new URL(request.url ?? '/', 'http://localhost');
    let body = '';
    for await (const chunk of request) body += chunk;
    try {
      if (url.pathname.startsWith('/mock/')) return this.control(url, response);
      if (this.failing) {
        request.socket.destroy();
        return;
      }
      response.setHeader('Content-Security-Policy', contentSecurityPolicy);
      response.setHeader('X-Content-Type-Options', 'nosniff');
      if (url.pathname === '/docs.json') return this.json(response, this.options.docs ? { is_there: true } : {});
      if (!url.pathname.startsWith('/v1/')) return this.file(url.pathname, request, response);
      if (request.method !== 'GET' && request.headers['x-rigcal'] !== '1') {
        this.counts.withoutHeader += 1;
        throw new Refusal(403, 'PERMISSION_DENIED', 'the header X-Rigcal is missing');
      }
      await this.route(request, url, body === '' ? {} : (JSON.parse(body) as Record<string, unknown>), response);
    } catch (error) {
      const refusal = error instanceof Refusal ? error : new Refusal(500, 'INTERNAL', String(error));
      this.json(response, { code: refusal.code, message: refusal.message }, refusal.status);
    }
  }

  private json(response: ServerResponse, value: unknown, status = 200): void {
    response.writeHead(status, { 'Content-Type': 'application/json', 'Cache-Control': 'no-store' });
    response.end(JSON.stringify(value));
  }

  private control(url: URL, response: ServerResponse): void {
    const action = url.pathname.slice('/mock/'.length);
    if (action === 'advance') this.rig.advance(Number(url.searchParams.get('s') ?? 1));
    else if (action === 'fail') this.failing = url.searchParams.get('on') === '1';
    else if (action === 'restart') this.restart();
    else if (action === 'blind') this.rig.cameras[Number(url.searchParams.get('i') ?? 0)]!.blind = true;
    this.json(response, this.counts);
  }

  private file(path: string, request: IncomingMessage, response: ServerResponse): void {
    const wanted = normalize(path === '/' || path === '/login' ? '/index.html' : path === '/pattern' ? '/pattern.html' : path);
    const name = join(this.options.dist, wanted);
    if (!existsSync(name)) {
      response.writeHead(404);
      response.end();
      return;
    }
    const zipped = String(request.headers['accept-encoding']).includes('gzip');
    let content: Uint8Array = readFileSync(name);
    const etag = createHash('sha256').update(content).digest('hex').slice(0, 16);
    if (zipped) content = gzipSync(content);
    response.writeHead(200, { 'Content-Type': types[extname(name)] ?? 'application/octet-stream',
      ...(zipped ? { 'Content-Encoding': 'gzip' } : {}),
      ETag: `"${etag}"` });
    response.end(content);
  }

  private session(id: string): Session {
    const session = this.rig.session?.id === id ? this.rig.session : this.sessions.get(id);
    if (!session) throw new Refusal(404, 'NOT_FOUND', `there is no session "${id}"`);
    return session;
  }

  private boardCameras(): SessionCamera[] {
    return this.rig.cameras.map((camera) => ({ agent_id: camera.agent, description: { camera: camera.name,
      image_size_px: { width: 1440, height: 1080 }, ...(this.boardViews.has(camera.name) ? {}
        : { intrinsics: { model: 'MODEL_BROWN_CONRADY', fx_px: 1100 } }) } }));
  }

  private allSessions(): Session[] {
    const all = new Map(this.sessions);
    if (this.rig.session?.id) all.set(this.rig.session.id, this.rig.parts().session!);
    return [...all.values()].reverse();
  }

  /** Without a body the camera is dropped. */
  private choose(camera: string, body: Record<string, unknown> | undefined): object {
    if (body === undefined) {
      const chosen = this.offered.find((offer) => offer.camera === camera);
      if (!chosen) throw new Refusal(404, 'NOT_FOUND', `no connected agent has chosen a camera '${camera}'`);
      chosen.use = 'USE_FREE';
      delete chosen.camera;
    } else {
      if (this.offered.some((offer) => offer.camera === camera)) {
        throw new Refusal(409, 'ALREADY_EXISTS', `the name '${camera}' is taken by the agent's configuration; give another name`);
      }
      const device = this.offered.find((offer) => offer.device === body['device'])!;
      device.use = 'USE_TAKES_PART';
      device.camera = camera;
      this.lastLens = String(body['calibration_yaml'] ?? '');
    }
    return { agent_id: 'pc-1', rig: 'rig', camera };
  }

  /** A learning takes four questions. */
  private detector(camera: string, verb: string | undefined, body: Record<string, unknown>): Detector {
    const configured = { hue_max_deg: 50, saturation_min: 0.35, value_min: 60, washed_out_min: 250 };
    const detector: Detector = this.detectors.get(camera) ?? { colour: configured };
    this.detectors.set(camera, detector);
    const learning = detector.learning;
    if (learning?.state === 'STATE_RUNNING') {
      if (verb) throw new Refusal(409, 'FAILED_PRECONDITION', `camera ${camera} learns now; try again when it has ended`);
      learning.frame_count = (learning.frame_count ?? 0) + 25;
      if (learning.frame_count < 100) return detector;
      learning.state = this.learningFault ? 'STATE_FAILED' : 'STATE_SUCCEEDED';
      learning.message = this.learningFault || 'learnt from 100 frames';
      if (!this.learningFault && learning.kind === 'KIND_MASK') {
        Object.assign(detector, { mask_learnt: true, ignored_pixel_count: 1234, ignored_share: 0.0008 });
      } else if (!this.learningFault) {
        Object.assign(detector, { colour_learnt: true, colour: { ...configured, hue_min_deg: 340, hue_max_deg: 15 } });
      }
    } else if (verb === 'learn_mask' || verb === 'tune') {
      if (!this.rig.capturing) {
        throw new Refusal(409, 'FAILED_PRECONDITION', `camera ${camera} takes frames only while a session captures; start one, then learn`);
      }
      detector.learning = { kind: verb === 'tune' ? 'KIND_COLOUR' : 'KIND_MASK', state: 'STATE_RUNNING', wanted_frame_count: 100 };
    } else if (verb === 'clear_mask') {
      Object.assign(detector, { mask_learnt: false, ignored_pixel_count: 0, ignored_share: 0 });
    } else if (verb === 'set_colour') {
      const colour = body['colour'] as ColourRange | undefined;
      Object.assign(detector, { colour: colour ?? configured, colour_learnt: colour !== undefined });
    }
    return detector;
  }

  private async route(request: IncomingMessage, url: URL, body: Record<string, unknown>,
    response: ServerResponse): Promise<void> {
    const path = `${request.method} ${url.pathname}`;
    if (path === 'POST /v1/login') {
      if (body['token'] !== 'rk1.letmein') throw new Refusal(401, 'UNAUTHENTICATED', 'this token is not known, or was used');
      response.setHeader('Set-Cookie', 'rigcal=1; HttpOnly; SameSite=Strict; Path=/');
      return this.json(response, {});
    }
    if (this.options.locked && !String(request.headers.cookie ?? '').includes('rigcal=1')) {
      throw new Refusal(401, 'UNAUTHENTICATED', 'open the link that `rigcal token create --role operator` prints');
    }
    let match: RegExpExecArray | null;
    if (path === 'GET /v1/live') {
      this.counts.live += 1;
      const since = url.searchParams.get('since_revision') ?? '';
      const live = this.live(since);
      response.setHeader('ETag', `"${live.revision}"`);
      if (since === live.revision && request.headers['if-none-match'] === `"${live.revision}"`) {
        this.counts.unchanged += 1;
        response.writeHead(304);
        response.end();
        return;
      }
      return this.json(response, { live });
    }
    if (path === 'GET /v1/status') {
      return this.json(response, { software_version: '0.1.0', server_id: 'b7c1', start_time: this.startTime,
        connected_agent_count: 3, session_count: this.sessions.size, store: { kind: 'sqlite', size_bytes: '18874368',
          free_bytes: '412316860416' }, ingest: { stored_observation_count: '83200' } });
    }
    if (path === 'GET /v1/agents') {
      const parts = this.rig.parts();
      return this.json(response, { agents: (parts.agents as { agents: { agent_id: string }[] }).agents.map((agent) => ({
        agent_id: agent.agent_id, host: agent.agent_id, rig: 'rig', connected: true, software_version: '0.1.0',
        ...(agent.agent_id === 'pc-1' ? { offered: this.offered } : {}),
        connect_time: new Date(epochMs - 60e3).toISOString(),
        cameras: this.rig.cameras.filter((camera) => camera.agent === agent.agent_id).map((camera) => ({
          camera: camera.name, image_size_px: { width: 1440, height: 1080 }, clock: { clock_id: camera.name },
          sensor: camera.name.startsWith('event') ? 'SENSOR_EVENT' : 'SENSOR_FRAME', source: 'simulated',
          intrinsics: { model: 'MODEL_BROWN_CONRADY', fx_px: 1100 },
          settings: { model: 'Simulated 1440', exposure_s: 0.0005, frame_rate_hz: 100, ptp: false } })),
        spool: { row_count: '34', bytes: '120000', limit_bytes: '1073741824', folder: '/var/lib/rigcal' } })) });
    }
    if ((match = /^(GET|POST) \/v1\/cameras\/([^/]+)\/detector(?::(\w+))?$/.exec(path))) {
      return this.json(response, { agent_id: 'pc', rig: 'rig', detector: this.detector(decodeURIComponent(match[2]!), match[3], body) });
    }
    if ((match = /^POST \/v1\/cameras\/([^/]+):(use|drop)$/.exec(path))) {
      return this.json(response, this.choose(decodeURIComponent(match[1]!), match[2] === 'use' ? body : undefined));
    }
    if ((match = /^GET \/v1\/cameras\/([^/]+)\/preview\.jpg$/.exec(path))) {
      if (this.withoutPreviews.has(decodeURIComponent(match[1]!))) {
        this.counts.refusedPreviews += 1;
        throw new Refusal(409, 'FAILED_PRECONDITION', `camera ${match[1]} has no frames: its source yields observations`);
      }
      this.counts.previews += 1;
      this.counts.previewsNow += 1;
      this.counts.previewsAtOnce = Math.max(this.counts.previewsAtOnce, this.counts.previewsNow);
      await new Promise((done) => setTimeout(done, 60));
      this.counts.previewsNow -= 1;
      response.writeHead(200, { 'Content-Type': 'image/svg+xml', 'Cache-Control': 'no-store' });
      response.end('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 144 108" width="360" height="270">' +
        '<rect width="144" height="108" fill="#1a1c1e"/><path d="M0 90L144 70V108H0z" fill="#24282b"/>' +
        '<g fill="#fff"><circle cx="60" cy="50" r="2"/><circle cx="68" cy="46" r="2"/><circle cx="84" cy="38" r="2"/></g>' +
        '<path d="M60 50L84 38" stroke="#6cf" stroke-width=".6"/></svg>');
      return;
    }
    if (path === 'GET /v1/sessions') {
      const state = /state=(\w+)/.exec(url.searchParams.get('filter') ?? '')?.[1];
      return this.json(response, { sessions: this.allSessions().filter((one) => !state || one.state === state) });
    }
    if (path === 'POST /v1/sessions') {
      const wanted = body as CreateSessionRequest;
      const positions = wanted.target?.marker_positions_m ?? [];
      if (positions.length === 0 && !wanted.target?.points?.length && !wanted.target?.board) throw new Refusal(400, 'INVALID_ARGUMENT', 'target: has no markers');
      if (this.rig.capturing) throw new Refusal(409, 'FAILED_PRECONDITION', `session ${this.rig.session?.id} captures`);
      if (this.rig.session?.id) this.sessions.set(this.rig.session.id, this.rig.parts().session!);
      const id = `s-${String(this.allSessions().length + 1).padStart(6, '0')}`;
      const session = this.rig.create({ id, rig: wanted.rig ?? 'rig', title: wanted.title, target: wanted.target,
        goal: wanted.goal, continues: wanted.continues, requested_cameras: wanted.camera_names });
      return this.json(response, { session });
    }
    if ((match = /^GET \/v1\/sessions\/([^/:]+)\/lenses\/([^/]+)$/.exec(path))) {
      const [id, camera] = [decodeURIComponent(match[1]!), decodeURIComponent(match[2]!)];
      if (!this.session(id).target?.board) throw new Refusal(409, 'FAILED_PRECONDITION', `the target of session '${id}' is no board`);
      return this.json(response, { lens: { ...mockLens(id, camera, this.boardViews.get(camera) ?? 0), has_lens: !this.boardViews.has(camera) } });
    }
    if ((match = /^(\w+) \/v1\/sessions\/([^/:]+)(?::(\w+))?$/.exec(path))) {
      const id = decodeURIComponent(match[2]!);
      const session = this.session(id);
      if (match[1] === 'GET') return this.json(response, { session: session.target?.board ? { ...session, cameras: this.boardCameras() } : session });
      if (match[1] === 'DELETE') {
        if (session.state === 'STATE_CAPTURING') throw new Refusal(409, 'FAILED_PRECONDITION', `session ${id} is capturing`);
        this.sessions.delete(id);
        if (this.rig.session?.id === id) this.rig.session = undefined;
        return this.json(response, {});
      }
      if (match[3] === 'start') {
        if (session.state !== 'STATE_CREATED') throw new Refusal(409, 'FAILED_PRECONDITION', `session ${id} has been stopped`);
        this.rig.start();
        return this.json(response, { session: this.rig.session });
      }
      if (match[3] === 'discard') {
        if (this.rig.capturing && this.rig.session?.id === id) throw new Refusal(409, 'FAILED_PRECONDITION', `session ${id} is capturing`);
        const change = { discard_time: body['undo'] ? undefined : new Date(epochMs).toISOString() };
        if (this.rig.session?.id === id) this.rig.change(change);
        else this.sessions.set(id, { ...session, ...change });
        return this.json(response, { session: this.session(id) });
      }
      if (match[3] === 'stop') {
        if (this.rig.session?.id === id && this.rig.capturing) this.rig.stop();
        return this.json(response, { session: this.session(id) });
      }
    }
    if (path === 'GET /v1/rigs') {
      return this.json(response, { rigs: [{ name: 'rig', active_calibration_id: this.activations[0]?.calibration_id ?? '' }] });
    }
    if (path === 'GET /v1/rigs/rig/activations') return this.json(response, { activations: this.activations });
    if (path === 'POST /v1/rigs/rig:rollback') {
      const to = this.activations[0]?.previous_calibration_id;
      if (!to) throw new Refusal(409, 'FAILED_PRECONDITION', 'rig rig has no calibration before the active one');
      return this.json(response, { activation: this.activate(to, body, true) });
    }
    if ((match = /^POST \/v1\/calibrations\/([^/:]+):activate$/.exec(path))) {
      return this.json(response, { activation: this.activate(decodeURIComponent(match[1]!), body, false) });
    }
    if (path === 'GET /v1/calibrations') {
      const of = /session_ids:([\w-]+)/.exec(url.searchParams.get('filter') ?? '')?.[1];
      return this.json(response, { calibrations: [...this.calibrations.values()].reverse().filter((one) => !of || one.session_ids?.includes(of))
        .map(({ cameras: _cameras, refused: _refused, ...rest }) => this.progress(rest)) });
    }
    if (path === 'POST /v1/calibrations') {
      const ids = (body['session_ids'] as string[] | undefined) ?? [];
      const options = body['options'] as CalibrationOptions | undefined;
      if (ids.length === 0 && options?.kind !== 'KIND_ORIGIN') throw new Refusal(400, 'INVALID_ARGUMENT', 'session_ids: is empty');
      ids.forEach((id) => this.session(id));
      const calibration = this.addCalibration(ids);
      calibration.options = options;
      if (options?.kind === 'KIND_ORIGIN') {
        Object.assign(calibration, { options, reference_camera: '', frame: { source: options.origin?.source, calibration_id: options.parent_id,
          residual_rms_m: 4e-4, lowest_camera: calibration.cameras?.[0]?.camera, lowest_camera_m: 1.23 } });
      }
      this.running.set(calibration.id!, 3);
      return this.json(response, { calibration: { ...calibration, state: 'STATE_QUEUED', cameras: [] } });
    }
    if ((match = /^(\w+) \/v1\/calibrations\/([^/:]+)(\/accuracy|\/residuals|\/exports|\/exports\/\w+)?$/.exec(path))) {
      const id = decodeURIComponent(match[2]!);
      const calibration = this.calibrations.get(id);
      if (!calibration) throw new Refusal(404, 'NOT_FOUND', `there is no calibration "${id}"`);
      if (match[1] === 'DELETE') {
        this.calibrations.delete(id);
        return this.json(response, {});
      }
      if (match[3] === '/accuracy') return this.json(response, mockAccuracy(id));
      if (match[3] === '/residuals') return this.json(response, { id, cameras: mockResiduals(calibration) });
      if (match[3] === '/exports') {
        return this.json(response, { formats: [{ name: 'opencv', description: 'one FileStorage YAML per camera' },
          { name: 'json', description: 'the whole calibration' },
          { name: 'blender', description: 'Python script that adds the cameras; no lens distortion',
            problem: url.searchParams.get('undistorted') || Number(url.searchParams.get('max_error_px')) > 20 ? '' : 'its cameras have no lens distortion' },
          { name: 'none', description: 'a format that this one lacks something for', problem: 'it has no metric scale' }] });
      }
      if (match[3]) {
        const [name, content] = { '/exports/json': ['json.json', JSON.stringify(calibration)],
          '/exports/blender': [`blender${url.searchParams.get('undistorted') ? '-undistorted' : ''}.py`, 'import bpy'] }[match[3]] ?? ['opencv.zip', 'PK'];
        response.writeHead(200, { 'Content-Type': 'application/octet-stream', 'Content-Disposition': `attachment; filename="${id}-${name}"` });
        response.end(content);
        return;
      }
      const left = this.running.get(id) ?? 0;
      this.running.set(id, left - 1);
      return this.json(response, { calibration: this.progress(calibration) });
    }
    if (path === 'GET /v1/tokens' || path === 'POST /v1/tokens') {
      if (this.options.local) {
        throw new Refusal(409, 'FAILED_PRECONDITION', 'this server listens on its own PC only, where nobody needs to join');
      }
      if (request.method === 'GET') return this.json(response, { tokens: [] });
      return this.json(response, { token: { id: 't-5f0c91aa', role: body['role'] ?? 'ROLE_AGENT',
        expire_time: new Date(Date.now() + 3600e3).toISOString() },
        join_string: `rk1.${Buffer.from('127.0.0.1:7421 a secret of thirty-two octets, and the hash of a CA').toString('base64url')}` });
    }
    throw new Refusal(404, 'NOT_FOUND', `there is no route ${path}`);
  }

  private activate(id: string, body: Record<string, unknown>, rollback: boolean): Activation {
    const calibration = this.calibrations.get(id);
    if (!calibration) throw new Refusal(404, 'NOT_FOUND', `there is no calibration "${id}"`);
    if (this.activationFault && !body['force']) throw new Refusal(409, 'FAILED_PRECONDITION', this.activationFault);
    const activation: Activation = { rig: 'rig', number: this.activations.length + 1, calibration_id: id, version: calibration.version,
      previous_calibration_id: this.activations[0]?.calibration_id ?? '', time: new Date(epochMs).toISOString(),
      reason: String(body['reason'] ?? ''), forced: this.activationFault !== '', rollback };
    this.activations.unshift(activation);
    return activation;
  }

  private progress(calibration: Calibration): Calibration {
    const left = this.running.get(calibration.id ?? '') ?? 0;
    if (left <= 0) return calibration;
    return { ...calibration, state: 'STATE_RUNNING', cameras: undefined, quality: undefined, findings: undefined,
      progress: { stage: 'CALIBRATION_STAGE_ADJUSTING', fraction: 1 - left / 4 } };
  }
}
