// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/grpc_log.h"

#include <grpc/support/log.h>
#include <spdlog/spdlog.h>

namespace rigcal::server {

void RouteGrpcLog() {
  gpr_set_log_function([](gpr_log_func_args* entry) {
    spdlog::debug("grpc: {}:{}: {}", entry->file, entry->line, entry->message);
  });
}

}  // namespace rigcal::server
