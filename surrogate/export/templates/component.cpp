#include "$component.h"

// The vehicle runs at its own tick, whatever the frame rate.
static constexpr double TickSeconds = 0.01;
static constexpr double MetersToUnreal = 100.0;

U$component::U$component() { PrimaryComponentTick.bCanEverTick = true; }

void U$component::BeginPlay() {
  Super::BeginPlay();
  State = grouser_at_rest();
  Start = GetOwner()->GetActorTransform();
  ensureMsgf(grouser_self_test() == 0, TEXT("$name fails its self-test"));
}

void U$component::TickComponent(float Seconds, ELevelTick Type, FActorComponentTickFunction* Function) {
  Super::TickComponent(Seconds, Type, Function);
  if (Terrain.Num() != GROUSER_PARAMETERS) return;
  const double Command[2] = {LeftBelt, RightBelt};
  for (Owed += Seconds; Owed >= TickSeconds; Owed -= TickSeconds) {
    const int Status =
        grouser_vehicle_tick(GROUSER_GUARDED, TickSeconds, Command, Terrain.GetData(), nullptr, &State, nullptr);
    if (Status != GROUSER_SOLVED) {
      UE_LOG(LogTemp, Warning, TEXT("$name: tick refused or not solved (%d)"), Status);
      Owed = 0.0;
      break;
    }
  }
  FallbackWeight = State.guard.fallback_weight;
  // Unreal counts y to the right and yaw clockwise from above.
  const FVector Place(MetersToUnreal * State.x, -MetersToUnreal * State.y, 0.0);
  const FRotator Turn(0.0, -FMath::RadiansToDegrees(State.heading), 0.0);
  GetOwner()->SetActorTransform(FTransform(Turn, Place) * Start);
}
