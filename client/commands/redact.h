// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace rigcal::client {

// A text that goes to somebody else, without what must stay secret; each place says "(removed)".
// Removed: blocks of PEM (keys and certificates), join strings (rk1.), user and password in URLs,
// what follows Bearer or Basic, and the values of names that hold one of password, passwd,
// passphrase, secret, token, credential, private, api_key, cookie or join: `name = value`, "name:
// value" and "name": "value", up to the end of the line or, in JSON, of the string. Names of hosts
// and users, addresses and paths stay.
std::string Redact(std::string_view text);

}  // namespace rigcal::client
