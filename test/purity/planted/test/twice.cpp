// Not compiled: breaches that the purity test must find.
namespace {
struct Twice {
  int nobody_else_sees;
};
}  // namespace
namespace roadfix {
class Twice {
  double b;
};
}  // namespace roadfix
TEST_CASE("half a name; the other half") {}
