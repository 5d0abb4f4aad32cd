// SPDX-License-Identifier: Apache-2.0
#include "server/rpc/call_hooks.h"

#include <google/protobuf/message.h>
#include <grpcpp/security/auth_metadata_processor.h>
#include <grpcpp/security/tls_certificate_provider.h>
#include <grpcpp/security/tls_certificate_verifier.h>
#include <grpcpp/security/tls_credentials_options.h>

#include <string>
#include <string_view>
#include <utility>

#include "common/wire/grpc_status.h"
#include "server/access/access_rules.h"

namespace rigcal::server {
namespace {

constexpr std::string_view kOwnServices = "/rigcal.v1.";
constexpr std::string_view kServedAsBytes = "/rigcal.v1.LiveService/GetLive";

std::string_view View(grpc::string_ref text) { return {text.data(), text.size()}; }

// Looks at the client's certificate in every TLS handshake. OpenSSL has proved by then that the
// client holds its key, and gRPC asks nobody else, so that the reason of a refusal is known here.
class ClientVerifier final : public grpc::experimental::ExternalCertificateVerifier {
 public:
  explicit ClientVerifier(CallSecurity* security) : security_(*security) {}

  bool Verify(grpc::experimental::TlsCustomVerificationCheckRequest* request,
              std::function<void(grpc::Status)> /*callback*/, grpc::Status* sync_status) override {
    const absl::StatusOr<Peer> peer = security_.Welcome(View(request->peer_cert()));
    if (!peer.ok()) {
      security_.audit().Write("handshake_refused", "",
                              {{"reason", std::string(peer.status().message())}});
    }
    *sync_status = wire::ToGrpc(peer.status());
    return true;
  }
  void Cancel(grpc::experimental::TlsCustomVerificationCheckRequest* /*request*/) override {}

 private:
  CallSecurity& security_;
};

// The one place where calls are authorised, whatever their service.
class CallAuthorizer final : public grpc::AuthMetadataProcessor {
 public:
  explicit CallAuthorizer(CallSecurity* security) : security_(*security) {}

  bool IsBlocking() const override { return false; }
  grpc::Status Process(const InputMetadata& metadata, grpc::AuthContext* context,
                       OutputMetadata* /*consumed*/, OutputMetadata* /*response*/) override {
    const auto path = metadata.find(":path");
    return wire::ToGrpc(
        security_.Authorise(*context, path == metadata.end() ? "" : View(path->second)));
  }

 private:
  CallSecurity& security_;
};

class CallObserver final : public grpc::experimental::Interceptor {
 public:
  CallObserver(grpc::experimental::ServerRpcInfo* info, const AccessRule* rule,
               CallSecurity* security)
      : info_(*info), rule_(rule), security_(*security) {}
  ~CallObserver() override { security_.EndCall(caller_); }

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    using Point = grpc::experimental::InterceptionHookPoints;
    if (methods->QueryInterceptionHookPoint(Point::POST_RECV_INITIAL_METADATA)) {
      caller_ = security_.CallerOf(*info_.server_context());
    }
    const bool audited = rule_ != nullptr && rule_->audited;
    if (methods->QueryInterceptionHookPoint(Point::POST_RECV_MESSAGE)) {
      // Services are generated from proto files: what they receive are messages, but for the live
      // state and gRPC's own services, which get bytes.
      const auto* message = rule_ != nullptr && rule_->method.starts_with(kOwnServices) &&
                                    rule_->method != kServedAsBytes
                                ? static_cast<google::protobuf::Message*>(methods->GetRecvMessage())
                                : nullptr;
      security_.NoteMessage(caller_,
                            kCallHeaderBytes + (message == nullptr ? 0 : message->ByteSizeLong()));
      if (audited && message != nullptr) request_ = message->ShortDebugString();
    }
    if (audited && methods->QueryInterceptionHookPoint(Point::PRE_SEND_STATUS)) {
      const absl::Status status = wire::FromGrpc(methods->GetSendStatus());
      security_.audit().WriteChange("change", Describe(caller_.peer),
                                    {{"address", caller_.address},
                                     {"method", std::string(rule_->method.substr(1))},
                                     {"request", request_},
                                     {"result", absl::StatusCodeToString(status.code())},
                                     {"message", std::string(status.message())}});
    }
    methods->Proceed();
  }

 private:
  grpc::experimental::ServerRpcInfo& info_;
  const AccessRule* const rule_;
  CallSecurity& security_;
  Caller caller_;
  std::string request_;
};

class CallObserverFactory final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit CallObserverFactory(CallSecurity* security) : security_(*security) {}

  grpc::experimental::Interceptor* CreateServerInterceptor(
      grpc::experimental::ServerRpcInfo* info) override {
    // The ingest service asks who calls by itself: an observer would see every message.
    if (std::string_view(info->method()).starts_with("/rigcal.v1.IngestService/")) return nullptr;
    return new CallObserver(info, FindAccessRule(info->method()), &security_);
  }

 private:
  CallSecurity& security_;
};

}  // namespace

std::shared_ptr<grpc::ServerCredentials> MakeTlsCredentials(const CheckedIdentity& identity,
                                                            CallSecurity* security) {
  const auto file = [&](const char* name) { return (identity.active() / name).string(); };
  constexpr unsigned kRefreshS = 1;
  grpc::experimental::TlsServerCredentialsOptions options(
      std::make_shared<grpc::experimental::FileWatcherCertificateProvider>(
          file("server.key"), file("server.crt"), file("ca.crt"), kRefreshS));
  options.watch_identity_key_cert_pairs();
  options.watch_root_certs();
  // A certificate is required; ClientVerifier says whether it is good, instead of OpenSSL, which
  // would not say why not.
  options.set_cert_request_type(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_BUT_DONT_VERIFY);
  options.set_certificate_verifier(
      grpc::experimental::ExternalCertificateVerifier::Create<ClientVerifier>(security));
  auto credentials = grpc::experimental::TlsServerCredentials(options);
  credentials->SetAuthMetadataProcessor(std::make_shared<CallAuthorizer>(security));
  return credentials;
}

std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> MakeCallObserver(
    CallSecurity* security) {
  return std::make_unique<CallObserverFactory>(security);
}

}  // namespace rigcal::server
