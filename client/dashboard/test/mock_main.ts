// SPDX-License-Identifier: Apache-2.0
// The mock server by hand: `npm run build && npm run mock`, then open the address it prints.
import { MockServer } from './mock_server';

const server = new MockServer({ dist: process.env['RIGCAL_DASHBOARD_DIST'] ?? 'dist',
  cameras: Number(process.env['CAMERAS'] ?? 8), speed: Number(process.env['SPEED'] ?? 1) });
console.log(await server.listen(Number(process.env['PORT'] ?? 7499)));
