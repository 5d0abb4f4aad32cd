// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <boost/asio/ssl/context.hpp>
#include <filesystem>
#include <memory>

#include "absl/status/statusor.h"

namespace rigcal::server {

// For connections from TLS 1.2 on, with a certificate and its private key, both PEM. Errors name
// the files.
absl::StatusOr<std::shared_ptr<boost::asio::ssl::context>> MakeTlsContext(
    const std::filesystem::path& certificate_file, const std::filesystem::path& key_file);

}  // namespace rigcal::server
