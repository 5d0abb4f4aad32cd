// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "server/http/http_request.h"

namespace rigcal::server {

// Where the documentation is beside this program as it is installed or built:
// ../share/doc/rigcal/html from the program's folder, /usr/share/doc/rigcal/html for a package.
std::filesystem::path DefaultDocsFolder();

// Serves the documentation, a folder with index.html, under "/docs/". Files are read when they are
// asked for, so that a package can bring them while the server runs. A folder is answered by its
// index.html; "/docs" leads to "/docs/". Nothing outside of `folder` is read: names with "..",
// hidden files, and links that lead out of it are not found. 404 with the sentence how to get the
// documentation: `folder` has no index.html. "/docs.json" is {"is_there": true} or {}, for pages
// that link to it.
std::vector<HttpRoute> DocsRoutes(const std::filesystem::path& folder);

}  // namespace rigcal::server
