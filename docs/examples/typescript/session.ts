// SPDX-License-Identifier: Apache-2.0
// A session from its creation to its calibration, by gRPC:
//   node dist/session.js [HOST:PORT] [SECONDS] [FOLDER OF proto]
import { credentials, loadPackageDefinition } from '@grpc/grpc-js';
import { loadSync } from '@grpc/proto-loader';
import { setTimeout as sleep } from 'node:timers/promises';

interface Session { id: string; state: string }
interface Headline { point_error_m: number; used_mean_px: number; unused_share: number; scale_sigma_rel: number }
interface Calibration {
  id: string;
  state: string;
  error: string;
  quality: { grade: string };
  headline: Headline | null;
}
/** A call of the API: a request to its answer. */
type Call = (request: object) => Promise<{ session: Session; calibration: Calibration }>;

const [address = '127.0.0.1:7420', seconds = '20', protos = '../../../proto'] = process.argv.slice(2);
const files = ['session_service', 'calibration_service'].map((name) => `rigcal/v1/${name}.proto`);
const api = loadPackageDefinition(loadSync(files,
  { includeDirs: [protos], keepCase: true, longs: String, enums: String, defaults: true })) as any;

/** The methods of a service, with promises. */
function service(name: string): (method: string) => Call {
  const client = new api.rigcal.v1[name](address, credentials.createInsecure());
  return (method) => (request) => new Promise((resolve, reject) => {
    client[method](request, { deadline: Date.now() + 30_000 },
      (error: Error | null, answer: any) => (error ? reject(error) : resolve(answer)));
  });
}

const sessions = service('SessionService');
const calibrations = service('CalibrationService');

const target = { kind: 'KIND_WAND', marker_positions_m: [0, 0.13, 0.39] };
const { id } = (await sessions('CreateSession')({ title: 'by TypeScript', target })).session;
await sessions('StartSession')({ id });
console.log(`session ${id} captures: wave for ${seconds} s`);
await sleep(1000 * Number(seconds));
await sessions('StopSession')({ id });
while ((await sessions('GetSession')({ id })).session.state !== 'STATE_FINISHED') await sleep(200);

let { calibration } = await calibrations('CreateCalibration')({ session_ids: [id] });
while (!['STATE_SUCCEEDED', 'STATE_FAILED', 'STATE_CANCELLED'].includes(calibration.state)) {
  await sleep(200);
  ({ calibration } = await calibrations('GetCalibration')({ id: calibration.id }));
}
console.log(`calibration ${calibration.id}: ${calibration.state} ${calibration.error}`);
if (calibration.headline) {
  const { point_error_m, used_mean_px, unused_share, scale_sigma_rel } = calibration.headline;
  console.log(`${calibration.quality.grade}: expected error ${(1e3 * point_error_m).toFixed(2)} mm + ` +
    `${(100 * scale_sigma_rel).toFixed(2)} % of every length, ` +
    `${used_mean_px.toFixed(3)} px, ${(100 * unused_share).toFixed(1)} % of the views not used`);
}
process.exit(calibration.state === 'STATE_SUCCEEDED' ? 0 : 1);
