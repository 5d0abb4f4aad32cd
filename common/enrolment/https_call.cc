// SPDX-License-Identifier: Apache-2.0
#include "common/enrolment/https_call.h"

#include <openssl/ssl.h>
#include <openssl/x509v3.h>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>
#include <exception>

#include "absl/strings/str_cat.h"
#include "common/identity/certificate.h"
#include "common/identity/join_string.h"
#include "common/identity/openssl_handles.h"

namespace rigcal {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using ErrorCode = boost::system::error_code;
using TlsStream = beast::ssl_stream<beast::tcp_stream>;

constexpr size_t kMaxAnswerBytes = 64 << 10;

absl::Status Unreachable(const HttpsRequest& request, const std::string& why) {
  return absl::UnavailableError(absl::StrCat("cannot ask ", request.address, " by HTTPS: ", why));
}

// Makes the handshake fail unless the certificate is for this host and of the CA.
absl::Status RequireServer(const HttpsRequest& request, const std::string& host,
                           asio::ssl::context* context, TlsStream* stream) {
  // add_certificate_authority() would trust every certificate in the text.
  const absl::StatusOr<Certificate> ca = ParseOnlyCertificate(request.ca_pem);
  if (!ca.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the CA's certificate ", std::string(ca.status().message())));
  }
  const openssl::CertificatePtr x509 = openssl::CertificateFromPem(ca->pem);
  X509_STORE* const trusted = SSL_CTX_get_cert_store(context->native_handle());
  if (!x509 || X509_STORE_add_cert(trusted, x509.get()) != 1) {
    return openssl::Error("trust the CA's certificate");
  }
  SSL* const ssl = stream->native_handle();
  X509_VERIFY_PARAM* const rules = SSL_get0_param(ssl);
  X509_VERIFY_PARAM_set_flags(rules, X509_V_FLAG_NO_CHECK_TIME);
  if (X509_VERIFY_PARAM_set1_ip_asc(rules, host.c_str()) != 1 &&
      X509_VERIFY_PARAM_set1_host(rules, host.c_str(), host.size()) != 1) {
    return absl::InvalidArgumentError(absl::StrCat("'", host, "' is no name of a host"));
  }
  SSL_set_verify(ssl, SSL_VERIFY_PEER, nullptr);
  return absl::OkStatus();
}

absl::Status HandshakeFault(const HttpsRequest& request, TlsStream& stream,
                            const ErrorCode& error) {
  const long verdict = SSL_get_verify_result(stream.native_handle());
  if (request.ca_pem.empty() || verdict == X509_V_OK) {
    return Unreachable(request,
                       absl::StrCat("no TLS server answers there (", error.message(), ")"));
  }
  const bool name =
      verdict == X509_V_ERR_HOSTNAME_MISMATCH || verdict == X509_V_ERR_IP_ADDRESS_MISMATCH;
  return absl::UnauthenticatedError(absl::StrCat(
      "the server at ", request.address, " is not to be trusted, so nothing was sent to it: ",
      name ? "its certificate is for other addresses"
           : "its certificate is not of the CA that this PC trusts (another rigcal server, or "
             "somebody between here and there)",
      " (", X509_verify_cert_error_string(verdict), ")"));
}

std::optional<absl::Time> DateOf(const http::response<http::string_body>& response) {
  absl::Time time;
  const auto date = response[http::field::date];
  if (absl::ParseTime("%a, %d %b %Y %H:%M:%S GMT", std::string(date.data(), date.size()), &time,
                      nullptr)) {
    return time;
  }
  return std::nullopt;
}

asio::awaitable<absl::StatusOr<HttpsAnswer>> Call(const HttpsRequest& request,
                                                  asio::io_context* io) {
  std::string host;
  uint16_t port = 0;
  if (!SplitHostPort(request.address, &host, &port)) {
    co_return absl::InvalidArgumentError(absl::StrCat("'", request.address, "' is not HOST:PORT"));
  }
  ErrorCode error;
  const auto token = [&error] { return asio::redirect_error(asio::use_awaitable, error); };
  asio::ip::tcp::resolver resolver(*io);
  const auto found = co_await resolver.async_resolve(host, std::to_string(port), token());
  if (error) co_return Unreachable(request, error.message());
  asio::ssl::context context(asio::ssl::context::tls_client);
  TlsStream stream(*io, context);
  auto& socket = beast::get_lowest_layer(stream);
  socket.expires_after(request.timeout);
  co_await socket.async_connect(found, token());
  if (error) co_return Unreachable(request, error.message());
  if (!request.ca_pem.empty()) {
    const absl::Status rules = RequireServer(request, host, &context, &stream);
    if (!rules.ok()) co_return rules;
  }
  co_await stream.async_handshake(asio::ssl::stream_base::client, token());
  if (error) co_return HandshakeFault(request, stream, error);

  http::request<http::string_body> message(http::string_to_verb(request.method), request.path, 11);
  message.set(http::field::host, request.address);
  message.set(http::field::content_type, "application/json");
  message.keep_alive(false);
  message.body() = request.body;
  message.prepare_payload();
  co_await http::async_write(stream, message, token());
  if (error) co_return Unreachable(request, error.message());
  beast::flat_buffer buffer(2 * kMaxAnswerBytes);
  http::response_parser<http::string_body> parser;
  parser.body_limit(kMaxAnswerBytes);
  co_await http::async_read(stream, buffer, parser, token());
  const ErrorCode too_long = http::error::body_limit;  // or what is no HTTP
  if (error.category() == too_long.category() && error != http::error::end_of_stream &&
      error != http::error::partial_message) {
    co_return absl::AbortedError(absl::StrCat("at ", request.address,
                                              " is no rigcal server: its answer cannot be read (",
                                              error.message(), ")"));
  }
  if (error) co_return Unreachable(request, error.message());
  co_return HttpsAnswer{.status = parser.get().result_int(),
                        .body = parser.get().body(),
                        .server_time = DateOf(parser.get())};
}

}  // namespace

absl::StatusOr<HttpsAnswer> CallHttps(const HttpsRequest& request) {
  asio::io_context io(1);
  absl::StatusOr<HttpsAnswer> answer = Unreachable(request, "no answer in time");
  try {
    asio::co_spawn(io, Call(request, &io),
                   [&](const std::exception_ptr& fault, absl::StatusOr<HttpsAnswer> result) {
                     if (!fault) {
                       answer = std::move(result);
                       return;
                     }
                     std::rethrow_exception(fault);
                   });
    // The resolver has no limit of its own.
    io.run_for(2 * request.timeout);
  } catch (const std::exception& error) {
    answer = Unreachable(request, error.what());
  }
  return answer;
}

}  // namespace rigcal
