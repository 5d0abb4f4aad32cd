#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Answers in a rigcal server's place, for deploy/demo-network.sh impostor.

impostor.py CERTIFICATE KEY CA_ANSWER SEEN: as HTTPS on port 7421, answers /v1/ca with what is in
the file CA_ANSWER at that moment, and appends what anybody sends to it to the file SEEN.
"""
import http.server
import ssl
import sys


class Impostor(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        with open(sys.argv[3], "rb") as file:
            body = file.read()
        self.send_response(200)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def do_POST(self):
        with open(sys.argv[4], "ab") as file:
            file.write(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_error(500)


context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
context.load_cert_chain(sys.argv[1], sys.argv[2])
server = http.server.ThreadingHTTPServer(("0.0.0.0", 7421), Impostor)
server.socket = context.wrap_socket(server.socket, server_side=True, do_handshake_on_connect=False)
server.serve_forever()
