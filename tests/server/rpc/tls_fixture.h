// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <grpcpp/channel.h>

#include <filesystem>
#include <memory>
#include <string>

#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/temporary_directory.h"
#include "tests/testing/test_ca.h"

namespace rigcal::testing {

// A server that listens with TLS only, over a real socket.
class TlsFixture : public RpcFixture {
 protected:
  void SetUp() override;

  // A new connection with this certificate.
  std::shared_ptr<grpc::Channel> Channel(const TestCertificate& certificate) const;
  // With a certificate that trusts `ca_pem`; an empty certificate is none.
  std::shared_ptr<grpc::Channel> Channel(const TestCertificate& certificate,
                                         const std::string& ca_pem) const;
  std::shared_ptr<grpc::Channel> AgentChannel(const std::string& agent_id) const {
    return Channel(ca_.MakeAgent(agent_id));
  }
  std::shared_ptr<grpc::Channel> UserChannel(const std::string& role) const {
    return Channel(ca_.MakeUser("kim", role));
  }
  std::filesystem::path identity() const { return folder_.path() / "identity"; }
  // Denies every certificate of `uri`, or only one.
  void Deny(const std::string& uri, const std::string& serial = "") const;
  // Takes a certificate on the server's record.
  void Record(const TestCertificate& certificate) const;
  // The audit log so far.
  std::string Audit() const;

  TemporaryDirectory folder_;
  TestCa ca_;
  TestCertificate server_certificate_;
  // Set before SetUp: the server has the CA's key, and takes only certificates on its record.
  bool has_ca_key_ = false;
};

}  // namespace rigcal::testing
