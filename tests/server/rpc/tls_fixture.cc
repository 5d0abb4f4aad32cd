// SPDX-License-Identifier: Apache-2.0
#include "tests/server/rpc/tls_fixture.h"

#include <grpcpp/create_channel.h>
#include <grpcpp/security/credentials.h>

#include <fstream>
#include <iterator>

#include "absl/time/clock.h"
#include "common/identity/certificate.h"
#include "server/identity/identity_registry.h"

namespace rigcal::testing {

void TlsFixture::SetUp() {
  server_certificate_ = ca_.MakeServer();
  ca_.WriteServerFolder(identity(), server_certificate_);
  if (has_ca_key_) ca_.WriteCaKey(identity());
  rpc_options_.endpoint.listen_address = "127.0.0.1:0";
  rpc_options_.endpoint.identity_folder = identity();
  rpc_options_.endpoint.listener.plain_loopback = false;
  rpc_options_.health_interval = std::chrono::milliseconds(50);
  audit_ = std::make_unique<server::AuditLog>(folder_.path() / "audit.jsonl");
  auto registry = server::AgentRegistry::Open({});
  ASSERT_THAT(registry, IsOk());
  registry_ = *std::move(registry);
  RpcFixture::SetUp();
}

std::shared_ptr<grpc::Channel> TlsFixture::Channel(const TestCertificate& certificate) const {
  return Channel(certificate, ca_.certificate_pem());
}

std::shared_ptr<grpc::Channel> TlsFixture::Channel(const TestCertificate& certificate,
                                                   const std::string& ca_pem) const {
  grpc::ChannelArguments arguments;
  // Channels with equal arguments would share a connection.
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
  return grpc::CreateCustomChannel(
      "127.0.0.1:" + std::to_string(port_),
      grpc::SslCredentials({.pem_root_certs = ca_pem,
                            .pem_private_key = certificate.key_pem,
                            .pem_cert_chain = certificate.certificate_pem}),
      arguments);
}

void TlsFixture::Deny(const std::string& uri, const std::string& serial) const {
  const std::string serials = serial.empty() ? "" : "\"" + serial + "\"";
  ReplaceTestFile(identity() / "denied.json",
                  R"({"denied": [{"uri": ")" + uri + R"(", "serials": [)" + serials + "]}]}");
}

void TlsFixture::Record(const TestCertificate& certificate) const {
  auto registry = server::IdentityRegistry::Open(identity() / "identities.json");
  ASSERT_THAT(registry, IsOk());
  const auto parsed = ParseCertificate(certificate.certificate_pem);
  ASSERT_THAT(parsed, IsOk());
  ASSERT_THAT(registry->Record(*parsed, /*joins=*/false, absl::Now()), IsOk());
}

std::string TlsFixture::Audit() const {
  std::ifstream stream(folder_.path() / "audit.jsonl");
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace rigcal::testing
