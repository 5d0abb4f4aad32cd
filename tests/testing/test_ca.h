// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace rigcal::testing {

struct TestCertificate {
  std::string certificate_pem;
  std::string key_pem;
  std::string serial;  // hexadecimal, lower case
};

// What a certificate says. By default an agent's, valid from an hour ago for 30 days.
struct CertificateWish {
  std::string common_name = "pc1";
  std::string role = "agent";  // empty: no OU
  std::vector<std::string> uris = {"rigcal://agents/pc1"};
  std::vector<std::string> hosts = {};  // IP addresses and DNS names
  int64_t begins_in_s = -3600;
  int64_t ends_in_s = 30 * 86'400;
  bool self_signed = false;
};

// A certificate authority for tests: P-256, made anew by each object.
class TestCa {
 public:
  TestCa();
  ~TestCa();
  TestCa(const TestCa&) = delete;
  TestCa& operator=(const TestCa&) = delete;

  const std::string& certificate_pem() const { return certificate_pem_; }
  TestCertificate Make(const CertificateWish& wish) const;
  TestCertificate MakeAgent(const std::string& agent_id) const;
  // operator, viewer or admin
  TestCertificate MakeUser(const std::string& name, const std::string& role) const;
  // For 127.0.0.1, ::1 and localhost.
  TestCertificate MakeServer() const;
  // ca.crt, server.crt and server.key, as for a server whose CA is elsewhere: it has no record of
  // the certificates.
  void WriteServerFolder(const std::filesystem::path& folder,
                         const TestCertificate& certificate) const;
  // ca.key, as of a server with a CA of its own, which takes only certificates on its record.
  void WriteCaKey(const std::filesystem::path& folder) const;

 private:
  struct Keys;

  std::unique_ptr<Keys> keys_;
  std::string certificate_pem_;
};

// Replaces the file at once.
void ReplaceTestFile(const std::filesystem::path& path, const std::string& text);

}  // namespace rigcal::testing
