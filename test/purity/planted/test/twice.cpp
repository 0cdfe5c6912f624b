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
