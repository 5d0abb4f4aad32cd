// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "rigcal/v1/agent_service.grpc.pb.h"
#include "rigcal/v1/calibration_service.grpc.pb.h"
#include "rigcal/v1/camera_service.grpc.pb.h"
#include "rigcal/v1/session_service.grpc.pb.h"
#include "rigcal/v1/status_service.grpc.pb.h"

namespace rigcal::client {

inline constexpr std::string_view kDefaultServer = "127.0.0.1:7420";
inline constexpr std::chrono::milliseconds kCallTimeout{10'000};

// INVALID_ARGUMENT unless `address` is HOST:PORT, with a port from 1 to 65535.
absl::Status ValidateServerAddress(std::string_view address);

// The services of one server. Connects with the first call; proxies named in the environment are
// not used, a rig's server being on its own network. Thread safe.
class ServerConnection {
 public:
  explicit ServerConnection(std::string address);

  const std::string& address() const { return address_; }
  rigcal::v1::SessionService::Stub& sessions() { return *sessions_; }
  rigcal::v1::CalibrationService::Stub& calibrations() { return *calibrations_; }
  rigcal::v1::AgentService::Stub& agents() { return *agents_; }
  rigcal::v1::CameraService::Stub& cameras() { return *cameras_; }
  rigcal::v1::StatusService::Stub& status() { return *status_; }

  // A unary call with a deadline: `Call(connection.sessions(), &SessionService::Stub::GetSession,
  // request)`. UNAVAILABLE: the server cannot be reached, or does not answer in time; the message
  // names it and says what to do. Else the server's own status.
  template <typename Stub, typename Service, typename Request, typename Response>
  absl::StatusOr<Response> Call(Stub& stub,
                                grpc::Status (Service::*method)(grpc::ClientContext*,
                                                                const Request&, Response*),
                                const std::type_identity_t<Request>& request,
                                std::chrono::milliseconds timeout = kCallTimeout) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + timeout);
    Response response;
    const grpc::Status status = (stub.*method)(&context, request, &response);
    if (!status.ok()) return Explain(status, timeout);
    return response;
  }

  // A stream of `Message`s from the server. `each` returns false to end it early, which is OK. A
  // `timeout` of zero is none; else the stream is given up after it, with DEADLINE_EXCEEDED where
  // something had come by then and UNAVAILABLE where nothing had.
  template <typename Stub, typename Service, typename Request, typename Message>
  absl::Status Read(Stub& stub,
                    std::unique_ptr<grpc::ClientReader<Message>> (Service::*method)(
                        grpc::ClientContext*, const Request&),
                    const std::type_identity_t<Request>& request, std::chrono::milliseconds timeout,
                    const std::function<bool(const std::type_identity_t<Message>&)>& each) {
    grpc::ClientContext context;
    if (timeout.count() > 0) context.set_deadline(std::chrono::system_clock::now() + timeout);
    const auto reader = (stub.*method)(&context, request);
    Message message;
    bool any = false;
    while (reader->Read(&message)) {
      any = true;
      if (each(message)) continue;
      context.TryCancel();
      // Read on until the library lets go of the stream; what still comes is not wanted.
      while (reader->Read(&message)) {
      }
      reader->Finish();
      return absl::OkStatus();
    }
    const grpc::Status status = reader->Finish();
    if (status.ok()) return absl::OkStatus();
    if (any && status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED) {
      return absl::DeadlineExceededError(status.error_message());
    }
    return Explain(status, timeout);
  }

  // Asks the server's health service (grpc.health.v1) for the whole server: "SERVING",
  // "NOT_SERVING", or another word of that protocol. UNIMPLEMENTED: it has none.
  absl::StatusOr<std::string> CheckHealth();

 private:
  absl::Status Explain(const grpc::Status& status, std::chrono::milliseconds timeout) const;

  const std::string address_;
  const std::shared_ptr<grpc::Channel> channel_;
  const std::unique_ptr<rigcal::v1::SessionService::Stub> sessions_;
  const std::unique_ptr<rigcal::v1::CalibrationService::Stub> calibrations_;
  const std::unique_ptr<rigcal::v1::AgentService::Stub> agents_;
  const std::unique_ptr<rigcal::v1::CameraService::Stub> cameras_;
  const std::unique_ptr<rigcal::v1::StatusService::Stub> status_;
};

}  // namespace rigcal::client
