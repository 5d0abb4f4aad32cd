// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/grpcpp.h>

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/net/user_identity.h"
#include "common/wire/server_access.h"
#include "common/wire/server_list.h"
#include "rigcal/v1/agent_service.grpc.pb.h"
#include "rigcal/v1/calibration_service.grpc.pb.h"
#include "rigcal/v1/camera_service.grpc.pb.h"
#include "rigcal/v1/session_service.grpc.pb.h"
#include "rigcal/v1/status_service.grpc.pb.h"

namespace rigcal::client {

inline constexpr std::string_view kDefaultServer = "127.0.0.1:7420";
inline constexpr std::chrono::milliseconds kCallTimeout{10'000};

template <typename Stub, typename Request, typename Response>
using UnaryMethod = grpc::Status (Stub::*)(grpc::ClientContext*, const Request&, Response*);

// The services of one server, or of the one of several that answers: a call that reached nobody, or
// a server that waits for its turn, is made again to the next one. Connects with the first call;
// proxies named in the environment are not used, a rig's server being on its own network. To
// another machine it uses the certificate of this user, without which every call is
// FAILED_PRECONDITION. Thread safe.
class ServerConnection {
 public:
  // `servers` as wire::ServerList::Parse reads it.
  explicit ServerConnection(const std::string& servers)
      : ServerConnection(servers, RenewedUserIdentity(servers)) {}
  ServerConnection(const std::string& servers, const wire::ClientIdentity& identity);

  // Of the server that is asked at the moment.
  std::string address() const { return link()->address; }

  // A unary call with a deadline: `Call(&SessionService::Stub::GetSession, request)`. UNAVAILABLE:
  // the server cannot be reached, or does not answer in time; the message names it and says what to
  // do. A server that does not let this user in: the error of WhyRefused, its reason on the last
  // line. Else the server's own status, with the correlation id under which the server has logged
  // it.
  template <typename Stub, typename Request, typename Response>
  absl::StatusOr<Response> Call(UnaryMethod<Stub, Request, Response> method,
                                const std::type_identity_t<Request>& request,
                                std::chrono::milliseconds timeout = kCallTimeout) {
    const auto begin = std::chrono::steady_clock::now();
    while (true) {
      const std::shared_ptr<const Link> link = this->link();
      if (!link->credentials.ok()) return link->credentials.status();
      grpc::ClientContext context;
      AddCorrelation(&context);
      context.set_deadline(std::chrono::system_clock::now() + timeout);
      Response response;
      const grpc::Status status = (Stub(link->channel).*method)(&context, request, &response);
      if (status.ok()) {
        Settle();
        return response;
      }
      if (!MayAskAgain(*link, status, context, begin)) return Explain(*link, status, timeout);
    }
  }
  // A call that names a resource and nothing else.
  template <typename Stub, typename Request, typename Response>
  absl::StatusOr<Response> CallWithId(UnaryMethod<Stub, Request, Response> method,
                                      const std::string& id) {
    Request request;
    request.set_id(id);
    return Call(method, request);
  }

  // A stream of `Message`s from the server. `each` returns false to end it early, which is OK. A
  // `timeout` of zero is none; else the stream is given up after it, with DEADLINE_EXCEEDED where
  // something had come by then and UNAVAILABLE where nothing had.
  template <typename Stub, typename Request, typename Message>
  absl::Status Read(std::unique_ptr<grpc::ClientReader<Message>> (Stub::*method)(
                        grpc::ClientContext*, const Request&),
                    const std::type_identity_t<Request>& request, std::chrono::milliseconds timeout,
                    const std::function<bool(const std::type_identity_t<Message>&)>& each) {
    const auto begin = std::chrono::steady_clock::now();
    while (true) {
      const std::shared_ptr<const Link> link = this->link();
      if (!link->credentials.ok()) return link->credentials.status();
      grpc::ClientContext context;
      AddCorrelation(&context);
      if (timeout.count() > 0) context.set_deadline(std::chrono::system_clock::now() + timeout);
      Stub stub(link->channel);
      const auto reader = (stub.*method)(&context, request);
      Message message;
      bool any = false;
      while (reader->Read(&message)) {
        if (!any) Settle();
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
      if (any) MoveOn(*link, status, context);
      if (any || !MayAskAgain(*link, status, context, begin)) {
        return Explain(*link, status, timeout);
      }
    }
  }

  // A stream in both directions: messages of `next` out, until it returns false, from a thread of
  // its own; what comes in to `each`, which returns false to end the stream early, which is OK.
  template <typename Stub, typename Request, typename Message>
  absl::Status Exchange(std::unique_ptr<grpc::ClientReaderWriter<Request, Message>> (Stub::*method)(
                            grpc::ClientContext*),
                        const std::function<bool(std::type_identity_t<Request>*)>& next,
                        const std::function<bool(const std::type_identity_t<Message>&)>& each) {
    const std::shared_ptr<const Link> link = this->link();
    if (!link->credentials.ok()) return link->credentials.status();
    grpc::ClientContext context;
    AddCorrelation(&context);
    Stub stub(link->channel);
    const auto stream = (stub.*method)(&context);
    std::thread writer([&] {
      Request request;
      while (next(&request)) {
        if (!stream->Write(request)) return;
      }
      stream->WritesDone();
    });
    Message message;
    bool ended_early = false;
    while (stream->Read(&message)) {
      if (ended_early || each(message)) continue;
      ended_early = true;
      context.TryCancel();
    }
    writer.join();
    const grpc::Status status = stream->Finish();
    if (status.ok() || ended_early) return absl::OkStatus();
    MoveOn(*link, status, context);
    return Explain(*link, status, std::chrono::milliseconds(0));
  }

  // Asks the server's health service (grpc.health.v1) for the whole server: "SERVING",
  // "NOT_SERVING", or another word of that protocol. UNIMPLEMENTED: it has none.
  absl::StatusOr<std::string> CheckHealth();

 private:
  // The way to one server.
  struct Link {
    std::string address;
    absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> credentials;
    std::shared_ptr<grpc::Channel> channel;
  };

  // Every call of this run of the program names the run's id, OwnCorrelationId().
  static void AddCorrelation(grpc::ClientContext* context);
  std::shared_ptr<const Link> MakeLink(const std::string& address) const;
  std::shared_ptr<const Link> link() const;
  // A server has answered.
  void Settle();
  bool HasAnswered(const Link& link) const;
  // Lines for those of other servers than this one; empty: there are none.
  std::string OtherRefusals(const Link& link) const;
  // What to do with a call that failed: it is over; no server has begun it and the next one can be
  // asked; or after a pause, because a server that waits is about to take over.
  enum class Next { kGiveUp, kAsk, kPause };
  // After a call over `link` that failed: the next call goes to another server.
  Next MoveOn(const Link& link, const grpc::Status& status, const grpc::ClientContext& context);
  // The same for a call that may be made again; waits where there is to be a pause. False: it is
  // over. `begin`: of the first attempt.
  bool MayAskAgain(const Link& link, const grpc::Status& status, const grpc::ClientContext& context,
                   std::chrono::steady_clock::time_point begin);
  absl::Status Explain(const Link& link, const grpc::Status& status,
                       std::chrono::milliseconds timeout) const;
  // A session or calibration that does not exist: with what was probably meant, or what there is.
  absl::Status ExplainUnknownId(const Link& link, const absl::Status& status) const;

  const wire::ClientIdentity identity_;
  mutable std::mutex mutex_;
  wire::ServerList servers_;
  std::shared_ptr<const Link> link_;  // to servers_.current()
  // What waiting servers and standbys said since one has answered, by their addresses.
  std::map<std::string, std::string> refusals_;
  std::set<std::string> answered_;  // addresses of servers that have answered
};

// The resource in a response.
template <typename Response>
absl::StatusOr<rigcal::v1::Session> SessionOf(absl::StatusOr<Response> response) {
  if (!response.ok()) return response.status();
  return std::move(*response->mutable_session());
}
template <typename Response>
absl::StatusOr<rigcal::v1::Calibration> CalibrationOf(absl::StatusOr<Response> response) {
  if (!response.ok()) return response.status();
  return std::move(*response->mutable_calibration());
}

}  // namespace rigcal::client
