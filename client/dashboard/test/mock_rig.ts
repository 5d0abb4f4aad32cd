// SPDX-License-Identifier: Apache-2.0
// A simulated rig for the page's tests: cameras in a ring look at a waved wand. The same steps give
// the same state, whatever the time of day. Its error figures are made up; only their shape matters.
import type {
  LiveAdvice, LiveAlert, LiveCamera, LiveEstimate, LiveFigure, LiveGoal, LivePairNeed, Session, Vector3,
} from '../src/api/types';
import { add, cross, normalized, scale, subtract, times, type Mat3, type Vec3 } from '../src/view/geometry';

const columns = 12;
const rows = 8;
const width = 1440;
const height = 1080;
const focal = 1100;
/** Start of the simulated time, ms since 1970. */
export const epochMs = Date.UTC(2026, 0, 5, 9, 0, 0);
const stepS = 0.05;

interface SimCamera {
  name: string;
  agent: string;
  centre: Vec3;
  camFromRig: Mat3;
  counts: Uint8Array;
  trail: { at: number; x0: number; y0: number; x1: number; y1: number }[];
  observations: number;
  wand: number;
  shared: number;
  blind: boolean;
}

const message = (v: Vec3): Vector3 => ({ x: v[0], y: v[1], z: v[2] });

/** Quaternion of a rotation matrix, w >= 0. */
export function quaternionOf(m: Mat3): { w: number; x: number; y: number; z: number } {
  const root = (value: number) => Math.sqrt(Math.max(0, value)) / 2;
  const w = root(1 + m[0][0] + m[1][1] + m[2][2]);
  return {
    w,
    x: Math.sign(m[2][1] - m[1][2] || 1) * root(1 + m[0][0] - m[1][1] - m[2][2]),
    y: Math.sign(m[0][2] - m[2][0] || 1) * root(1 - m[0][0] + m[1][1] - m[2][2]),
    z: Math.sign(m[1][0] - m[0][1] || 1) * root(1 - m[0][0] - m[1][1] + m[2][2]),
  };
}

function base64(bytes: Uint8Array): string {
  return Buffer.from(bytes).toString('base64');
}

/** The rig frame: y down as in the first camera, 2.5 m above the floor. */
export class MockRig {
  readonly cameras: SimCamera[] = [];
  private pairs = new Map<string, number>();
  private readonly voxels = new Map<number, number>();
  private history: LiveFigure[] = [];
  private estimateAt = -1;
  private wandNow: Vec3[] = [];
  private estimate: LiveEstimate = { state: 'STATE_WAITING' };
  private worstMm = 0;
  /** Simulated seconds since the start. */
  now = 0;
  private captureStart = 0;
  session: Session | undefined;
  reached = false;

  constructor(cameraCount: number) {
    const rings = Math.max(1, Math.ceil(cameraCount / 64));
    const wanted: Vec3 = [0, 0.9, 3];
    for (let i = 0; i < cameraCount; ++i) {
      const angle = (2 * Math.PI * i) / cameraCount;
      // A large rig stands in several rings.
      const away = 3.4 + 0.7 * (i % rings);
      const centre: Vec3 = [away * Math.sin(angle), i % 2 ? 0.35 : 0, 3 - away * Math.cos(angle)];
      const forward = normalized(subtract(wanted, centre));
      const right = normalized(cross([0, 1, 0], forward));
      this.cameras.push({
        name: `${i % 4 === 3 ? 'event' : 'frame'}_${i}`, agent: `pc-${1 + Math.floor((i * Math.max(3, Math.ceil(cameraCount / 8))) / cameraCount)}`,
        centre, camFromRig: [right, cross(forward, right), forward], counts: new Uint8Array(columns * rows),
        trail: [], observations: 0, wand: 0, shared: 0, blind: false,
      });
    }
    this.cameras.sort((a, b) => (a.name < b.name ? -1 : 1));
  }

  get capturing(): boolean {
    return this.session?.state === 'STATE_CAPTURING';
  }

  time(): string {
    return new Date(epochMs + this.now * 1000).toISOString();
  }

  create(session: Session): Session {
    this.session = { ...session, state: 'STATE_CREATED', create_time: this.time(), camera_count: 0 };
    return this.session;
  }

  start(): void {
    this.captureStart = this.now;
    this.reached = false;
    for (const camera of this.cameras) {
      camera.counts.fill(0);
      camera.trail = [];
      camera.observations = camera.wand = camera.shared = 0;
    }
    this.pairs.clear();
    this.voxels.clear();
    this.history = [];
    this.estimate = { state: 'STATE_WAITING' };
    this.session = { ...this.session, state: 'STATE_CAPTURING', start_time: this.time(),
      camera_count: this.cameras.length };
  }

  stop(reason = ''): void {
    this.session = { ...this.session, state: 'STATE_FINISHED', stop_time: this.time(), finish_time: this.time(),
      ...(reason ? { stop_reason: reason } : {}) };
  }

  /** Changes fields of the session. */
  change(fields: Partial<Session>): void {
    this.session = { ...this.session, ...fields };
  }

  /** Goes on by so many seconds. */
  advance(seconds: number): void {
    for (const end = this.now + seconds - 1e-9; this.now < end;) {
      this.now += stepS;
      if (this.capturing) this.capture();
      else for (const camera of this.cameras) camera.trail = camera.trail.filter((p) => this.now - p.at < 2);
    }
  }

  private project(camera: SimCamera, point: Vec3): [number, number] | undefined {
    const [x, y, z] = times(camera.camFromRig, subtract(point, camera.centre));
    if (z < 0.2) return undefined;
    const px: [number, number] = [(focal * x) / z + width / 2, (focal * y) / z + height / 2];
    return px[0] >= 0 && px[1] >= 0 && px[0] < width && px[1] < height ? px : undefined;
  }

  private capture(): void {
    const t = this.now - this.captureStart;
    const centre: Vec3 = [1.3 * Math.sin(0.83 * t), 0.9 + 0.8 * Math.sin(1.31 * t + 1), 3 + 1.3 * Math.sin(0.57 * t)];
    const along = normalized([Math.cos(1.7 * t), Math.sin(0.9 * t), Math.sin(1.7 * t)]);
    this.wandNow = [scale(along, -0.195), scale(along, -0.065), scale(along, 0.195)].map((v) => add(centre, v));
    const seen: SimCamera[] = [];
    for (const camera of this.cameras) {
      camera.observations += 5;
      const ends = camera.blind ? [] : [this.wandNow[0]!, this.wandNow[2]!].map((p) => this.project(camera, p));
      camera.trail = camera.trail.filter((p) => this.now - p.at < 2);
      const [a, b] = ends;
      if (!a || !b) continue;
      seen.push(camera);
      camera.wand += 5;
      camera.trail.push({ at: this.now, x0: a[0], y0: a[1], x1: b[0], y1: b[1] });
      for (const [x, y] of [a, b]) {
        const cell = Math.floor((y / height) * rows) * columns + Math.floor((x / width) * columns);
        camera.counts[cell] = Math.min(255, camera.counts[cell]! + 1);
      }
    }
    if (seen.length < 2) return;
    for (let i = 0; i < seen.length; ++i) {
      seen[i]!.shared += 2;
      // Of a very large rig, only those that needs speak of.
      for (let j = i + 1; j < Math.min(seen.length, this.cameras.length > 64 ? i + 3 : Infinity); ++j) {
        const key = `${seen[i]!.name} ${seen[j]!.name}`;
        this.pairs.set(key, (this.pairs.get(key) ?? 0) + 2);
      }
    }
    const index = centre.map((v, k) => Math.floor((v - [-1.8, -0.4, 1.2][k]!) / 0.3));
    const voxel = index[0]! + 12 * (index[1]! + 10 * index[2]!);
    this.voxels.set(voxel, (this.voxels.get(voxel) ?? 0) + 1);
    if (this.now - this.estimateAt >= 1.999) this.solve();
  }

  private solve(): void {
    this.estimateAt = this.now;
    const t = this.now - this.captureStart;
    const needs: LivePairNeed[] = [];
    for (let i = 0; i + 1 < this.cameras.length; ++i) {
      const [a, b] = [this.cameras[i]!, this.cameras[i + 1]!];
      const common = this.pairs.get(`${a.name} ${b.name}`) ?? 0;
      if (common < 200 && !a.blind && !b.blind) {
        needs.push({ camera_a: a.name, camera_b: b.name, common_count: common, needed_count: 200 });
      }
    }
    if (t < 6) {
      this.estimate = { state: 'STATE_WAITING', needs: needs.slice(0, 16),
        instant_count: Math.round(t * 40) };
      return;
    }
    const sigmas: number[] = [];
    const counts: number[] = [];
    let total = 0;
    for (let z = 0; z < 12; ++z) {
      for (let y = 0; y < 10; ++y) {
        for (let x = 0; x < 12; ++x) {
          const at: Vec3 = [-1.65 + x * 0.3, -0.25 + y * 0.3, 1.35 + z * 0.3];
          const n = this.voxels.get(x + 12 * (y + 10 * z)) ?? 0;
          const near = [1, -1, 12, -12, 120, -120].some((d) => this.voxels.has(x + 12 * (y + 10 * z) + d));
          const distance = Math.hypot(at[0], at[1] - 0.9, at[2] - 3);
          counts.push(n);
          total += n;
          sigmas.push(n > 0 || near ? (0.16 + 2.1 / Math.sqrt(t)) * (0.5 + 0.35 * distance ** 2) / (1 + 0.1 * n) + 0.08 : 0);
        }
      }
    }
    const sorted = sigmas.filter((s) => s > 0).sort((a, b) => a - b);
    const p95 = sorted[Math.floor(sorted.length * 0.95)] ?? 0;
    const worst = sorted.at(-1) ?? 0;
    const w = sigmas.indexOf(worst);
    const worstAt: Vec3 = [-1.65 + (w % 12) * 0.3, -0.25 + (Math.floor(w / 12) % 10) * 0.3,
      1.35 + Math.floor(w / 120) * 0.3];
    this.worstMm = worst;
    this.history.push({ time_s: t, p95_mm: p95 });
    const places: LiveAdvice[] = [
      { text: `low, between ${this.cameras[0]!.name} and ${this.cameras[2]!.name}, wand upright`,
        point_m: message(worstAt), cameras: [this.cameras[0]!.name, this.cameras[2]!.name],
        expected_p95_mm: p95 * 0.82 },
      { text: `high, near ${this.cameras[1]!.name}, wand level`, point_m: { x: 0.9, y: 0.1, z: 3.8 },
        cameras: [this.cameras[1]!.name, this.cameras[3]!.name], expected_p95_mm: p95 * 0.9 },
    ];
    this.estimate = {
      state: 'STATE_READY', time: this.time(), needs: [], instant_count: Math.min(2000, total),
      solve_duration_s: 0.18, scale_known: true,
      cameras: this.cameras.filter((camera) => !camera.blind).map((camera, i) => ({
        camera: camera.name,
        cam_from_rig: { rotation: quaternionOf(camera.camFromRig),
          translation_m: message(scale(times(camera.camFromRig, camera.centre), -1)) },
        time_offset_s: (i - 3) * 0.0021, time_offset_sigma_s: 4e-4 / Math.sqrt(t),
        reprojection_rms_px: 0.28 + 0.02 * i, focal_length_px: focal,
      })),
      marker_positions_m: [0, 0.13, 0.39],
      volume: { origin_m: { x: -1.65, y: -0.25, z: 1.35 }, step_m: 0.3, count_x: 12, count_y: 10, count_z: 12,
        sigma_mm: sigmas.map((s) => Number(s.toFixed(3))), wand_counts: counts,
        median_mm: sorted[Math.floor(sorted.length / 2)] ?? 0, p95_mm: p95, worst_mm: worst,
        worst_point_m: message(worstAt), scale_sigma_rel: 3e-4 },
      history: this.history.slice(-300),
      held_out: { rms_px: 0.33, expected_rms_px: 0.31, agrees: t > 14 },
      advice: places, wand_m: this.wandNow.map(message),
    };
    const goal = this.session?.goal;
    const min = Number((goal?.min_duration ?? '20s').replace('s', ''));
    if (goal?.until_mm && p95 < goal.until_mm && t > min && t > 14) {
      this.reached = true;
      this.stop(`the expected error is ${p95.toFixed(2)} mm`);
    }
  }

  /** The parts of the live state, each as it is now. */
  parts(): { session: Session | undefined; cameras: LiveCamera[]; overlap: object; estimate: LiveEstimate;
    alerts: { alerts: LiveAlert[] }; agents: object; goal: LiveGoal | undefined } {
    const names = this.cameras.map((camera) => camera.name);
    const counts: number[] = [];
    for (let i = 0; i < names.length && names.length <= 256; ++i) {
      for (let j = i + 1; j < names.length; ++j) {
        counts.push(this.pairs.get(`${names[i]} ${names[j]}`) ?? this.pairs.get(`${names[j]} ${names[i]}`) ?? 0);
      }
    }
    const t = this.now - this.captureStart;
    const alerts: LiveAlert[] = this.cameras.filter((camera) => camera.blind && this.capturing && t > 8)
      .map((camera) => ({ kind: 'no_wand', severity: 'SEVERITY_ERROR', camera: camera.name,
        text: `${camera.name} has not seen the wand for ${8} s of waving; check lens cap, exposure and threshold.`,
        since: new Date(epochMs + (this.captureStart + 8) * 1000).toISOString() }));
    if (this.capturing && t > 12) {
      alerts.push({ kind: 'clock_off', severity: 'SEVERITY_WARNING', camera: names[1]!,
        text: `The clock of ${names[1]} is 12 ms off; it is corrected, but check its trigger.`,
        since: new Date(epochMs + (this.captureStart + 12) * 1000).toISOString() });
    }
    const p95 = this.estimate.volume?.p95_mm ?? 0;
    const until = this.session?.goal?.until_mm;
    return {
      session: this.session ? { ...this.session,
        observation_count: String(this.cameras.reduce((sum, camera) => sum + camera.observations, 0)),
        wand_count: String(this.cameras.reduce((sum, camera) => sum + camera.wand, 0)) } : undefined,
      cameras: this.cameras.map((camera, i) => ({
        camera: camera.name, agent_id: camera.agent,
        state: this.capturing ? 'STATE_CAPTURING' : 'STATE_IDLE', image_size_px: { width, height },
        observation_rate_hz: this.capturing ? 100 : 0,
        wand_rate_hz: this.capturing ? Math.round(camera.trail.length / 2 * 5) : 0,
        observation_count: String(camera.observations), wand_count: String(camera.wand),
        backlog_count: this.capturing && i === 2 ? '34' : '0', dropped_count: i === 4 ? '3' : '0',
        clock: { ...(this.estimate.state === 'STATE_READY' ? { time_offset_s: (i - 3) * 0.0021,
          time_offset_sigma_s: 0.00004 } : {}), sample_spread_s: 0.00012 + 0.00003 * i, clock_epoch_count: 1,
          ...(i < 3 ? { wand: 2, wand_time_s: 754.2 } : {}) },
        coverage: { columns, rows, counts: base64(camera.counts),
          covered_share: camera.counts.filter((value) => value >= 5).length / camera.counts.length },
        // As of the real server.
        trail: this.cameras.length > 64 ? [] : camera.trail.map((point) => ({ age_ms: Math.round((this.now - point.at) * 1000), x0_px: point.x0,
          y0_px: point.y0, x1_px: point.x1, y1_px: point.y1 })),
        shared_instant_count: camera.shared, shared_instant_goal: 400,
        reprojection_rms_px: this.estimate.state === 'STATE_READY' && !camera.blind ? 0.28 + 0.02 * i : 0,
        has_preview: !camera.name.startsWith('event'),
      })),
      overlap: { cameras: names, counts },
      estimate: this.estimate, alerts: { alerts },
      agents: { agents: [...new Set(this.cameras.map((camera) => camera.agent))].sort().map((agent, i) => ({
        agent_id: agent, host: agent, connected: true, spool_rows: i === 0 ? '34' : '0',
        spool_bytes: String(120000 * (i + 1)), spool_limit_bytes: '1073741824', software_version: '0.1.0' })) },
      goal: until ? { until_mm: until, now_mm: p95, reached: this.reached,
        why_not: this.reached ? '' : p95 === 0 ? 'there is no estimate yet'
          : p95 >= until ? `the expected error is ${p95.toFixed(2)} mm, and ${this.worstMm.toFixed(2)} mm at worst`
            : 'held-out data do not agree yet' } : undefined,
    };
  }
}
