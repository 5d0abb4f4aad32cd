// SPDX-License-Identifier: Apache-2.0
#include "server/http/tls_context.h"

#include <boost/asio/buffer.hpp>
#include <string>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "common/file/durable_file.h"
#include "common/identity/private_key.h"
#include "common/status/status_macros.h"

namespace rigcal::server {

namespace asio = boost::asio;
using Context = asio::ssl::context;

absl::StatusOr<std::shared_ptr<Context>> MakeTlsContext(
    const std::filesystem::path& certificate_file, const std::filesystem::path& key_file) {
  RIGCAL_ASSIGN_OR_RETURN(const std::string certificate, ReadSmallFile(certificate_file));
  RIGCAL_ASSIGN_OR_RETURN(const std::string key, ReadSmallFile(key_file));
  RIGCAL_RETURN_IF_ERROR(CheckKeyOf(
      certificate, key, absl::StrCat(certificate_file.string(), " and ", key_file.string())));
  auto context = std::make_shared<Context>(Context::tls_server);
  boost::system::error_code error;
  context->set_options(Context::default_workarounds | Context::no_sslv2 | Context::no_sslv3 |
                       Context::no_tlsv1 | Context::no_tlsv1_1);
  context->use_certificate_chain(asio::buffer(certificate), error);
  if (!error) context->use_private_key(asio::buffer(key), Context::pem, error);
  if (!error) return context;
  return absl::FailedPreconditionError(
      absl::StrCat("cannot use ", certificate_file.string(), " for HTTPS: ", error.message()));
}

}  // namespace rigcal::server
