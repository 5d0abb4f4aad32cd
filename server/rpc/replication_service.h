// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/impl/service_type.h>

#include <filesystem>
#include <memory>
#include <string>

#include "server/replica/standby_book.h"
#include "server/store/store.h"

namespace rigcal::server {

// Of this process, random: a server must not follow itself.
const std::string& ProcessId();

// The service of a server that may be followed. `data_dir`: whose files go with the store; empty:
// none do.
std::unique_ptr<grpc::Service> MakeReplicationService(Store* store, StandbyBook* standbys,
                                                      std::filesystem::path data_dir);

}  // namespace rigcal::server
