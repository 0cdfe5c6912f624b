// Not compiled: breaches that the purity test must find.
namespace roadfix {
struct Twice {
  int a;
};
}  // namespace roadfix
namespace roadfix::slam {
struct Twice {
  int other_name;
};
}  // namespace roadfix::slam
