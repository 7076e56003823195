// SPDX-FileCopyrightText: The Lineament authors
// SPDX-License-Identifier: Apache-2.0
#include "report/html.hpp"

#include "lineament/io/image_file.hpp"
#include "report/report_fixtures.hpp"
#include "support/matchers.hpp"

#include <cstring>
#include <limits>

namespace lineament {
namespace {

std::string base64_of(const std::string& text)
{
    return html::base64(std::as_bytes(std::span(text)));
}

TEST(Html, EscapeLeavesNoMarkup)
{
    EXPECT_EQ(html::escape("<b a=\"1\" c='2'>&"), "&lt;b a=&quot;1&quot; c=&#39;2&#39;&gt;&amp;");
    EXPECT_EQ(html::escape("Zoë 顔 🙂"), "Zoë 顔 🙂");
}

TEST(Html, EscapeReplacesControlCharactersAndBrokenUtf8)
{
    EXPECT_EQ(html::escape(std::string("a\0b\x1b", 4)), "a\xEF\xBF\xBD"
                                                        "b\xEF\xBF\xBD");
    EXPECT_EQ(html::escape("line\n\ttab"), "line\n\ttab");
    for (const std::string broken : {"\xC0\xAF", "\xE2\x82", "\xED\xA0\x80", "\xF5\x80\x80\x80", "\x80"}) {
        const std::string escaped = html::escape(broken + "<");
        EXPECT_EQ(escaped.find(broken), std::string::npos);
        EXPECT_TRUE(escaped.ends_with("&lt;")) << escaped; // nothing that follows is swallowed
    }
}

TEST(Html, JsonStringCannotEndAScript)
{
    EXPECT_EQ(html::json_string("</script>"), "\"\\u003c/script\\u003e\"");
    EXPECT_EQ(html::json_string("a\"b\\c\n"), "\"a\\\"b\\\\c\\u000a\"");
}

TEST(Html, NumberIsFixedAndHasNoMinusZero)
{
    EXPECT_EQ(html::number(3.14159, 2), "3.14");
    EXPECT_EQ(html::number(-0.001, 2), "0.00");
    EXPECT_EQ(html::number(-0.006, 2), "-0.01");
    EXPECT_EQ(html::number(std::numeric_limits<double>::quiet_NaN(), 2), "–");
    EXPECT_EQ(html::number(std::numeric_limits<double>::max(), 0).size(), 309u);
}

TEST(Html, Base64AsInRfc4648)
{
    EXPECT_EQ(base64_of(""), "");
    EXPECT_EQ(base64_of("f"), "Zg==");
    EXPECT_EQ(base64_of("fo"), "Zm8=");
    EXPECT_EQ(base64_of("foo"), "Zm9v");
    EXPECT_EQ(base64_of("foobar"), "Zm9vYmFy");
}

TEST(Html, Base64OfFloatsIsLittleEndianAndExact)
{
    const std::vector<float> values = {0.0f, -1.5f, 3.4e38f, 1e-40f};
    const std::string bytes = test::decode_base64(html::base64_floats(values));
    ASSERT_EQ(bytes.size(), 16u);
    for (std::size_t i = 0; i < values.size(); ++i) {
        std::uint32_t bits = 0;
        for (std::size_t k = 4; k-- > 0;) {
            bits = bits << 8 | static_cast<unsigned char>(bytes[4 * i + k]);
        }
        float value;
        std::memcpy(&value, &bits, 4);
        EXPECT_EQ(value, values[i]);
    }
    const std::vector<std::int16_t> shorts = {1, -2};
    EXPECT_EQ(test::decode_base64(html::base64_int16(shorts)), std::string("\x01\x00\xfe\xff", 4));
}

TEST(Html, ImageAddressHoldsThePictureReducedAndKeepsAlpha)
{
    const auto decoded = [](const std::string& address) {
        const std::string file = test::decode_base64(address.substr(address.find(',') + 1));
        return parse_image(std::as_bytes(std::span(file)), "address");
    };
    const std::string jpeg = html::image_address(ImageU8(400, 100, 3, 77), 100);
    EXPECT_TRUE(jpeg.starts_with("data:image/jpeg;base64,"));
    EXPECT_EQ(decoded(jpeg), ImageU8(100, 25, 3, 77));
    EXPECT_EQ(decoded(html::image_address(ImageU8(40, 10, 1, 77), 100)), ImageU8(40, 10, 3, 77));
    const std::string png = html::image_address(ImageU8(40, 1000, 4, 0), 100);
    EXPECT_TRUE(png.starts_with("data:image/png;base64,"));
    EXPECT_EQ(decoded(png), ImageU8(4, 100, 3, 255)); // transparent: the reader lays it over white
}

} // namespace
} // namespace lineament
