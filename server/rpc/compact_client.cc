// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/compact_client.h"

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>

#include "absl/strings/str_cat.h"
#include "common/status/status_macros.h"
#include "common/wire/grpc_status.h"
#include "rigcal/v1/maintenance_service.grpc.pb.h"

namespace rigcal::server {

absl::Status CompactRunningServer(const std::string& address,
                                  const std::function<void(const CompactProgress&)>& progress) {
  const auto stub = v1::MaintenanceService::NewStub(
      grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
  grpc::ClientContext context;
  const auto reader = stub->Compact(&context, {});
  v1::CompactResponse response;
  while (reader->Read(&response)) {
    progress({.fraction = response.fraction(), .size_bytes = response.size_bytes()});
  }
  const absl::Status status = wire::FromGrpc(reader->Finish());
  if (!absl::IsUnavailable(status)) return status;
  return absl::UnavailableError(absl::StrCat("the server at ", address,
                                             " does not answer: ", std::string(status.message()),
                                             "; name it with --server"));
}

}  // namespace rigcal::server
